# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every kernel under the address and undefined-behaviour sanitizers, or under any flags, against the interpreted form.

    python benchmarks/sanitize_kernels.py
    python benchmarks/sanitize_kernels.py --flags=-O3

Without --flags: -O1 with both sanitizers; the script starts itself again with their libraries loaded first. A fault that a
sanitizer finds is printed and ends the script. Every part of a kernel is built for one lane and for a whole vector; the
filter and the closed loop come along where fish_train is installed. Prints the largest relative error of each and ends
with 1 where one exceeds the tolerance.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from fish_sim.compiled import TOLERANCE, Check, compile_library, compiler, lanes, largest
from fish_sim.effects import EFFECTS
from fish_sim.kernel_source import PARTS, kernel_source
from fish_sim.model import Structure
from fish_sim.scheme import Scheme, default_scheme
from fish_sim.self_check import kernel_errors
from fish_sim.step import Stepper

SANITIZED = (
    "-O1",
    "-g",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)
STRUCTURES: tuple[Structure, ...] = ((1, ()), (3, ()), (1, tuple(EFFECTS.values())))
METHODS = ("euler", "dop853")  # of one link, as well as the default

Case = tuple[str, str, Check]  # name, C text, its check


def kernels() -> Iterator[Case]:
    """Every part of the steppers' kernels."""
    schemes = [(structure, default_scheme(structure[0])) for structure in STRUCTURES]
    schemes += [((1, ()), Scheme(method)) for method in METHODS]
    for structure, scheme in schemes:
        for width in (1, lanes()):
            for part in PARTS:
                name = f"n = {structure[0]}, {len(structure[1])} effects, {scheme.method}, width {width}: {part}"

                check = partial(kernel_errors, structure, scheme, width, part)
                yield name, kernel_source(structure, scheme, width, part), check


def filters() -> Iterator[Case]:
    """The filter, with the default integrator."""
    from fish_sysid.estimation.ekf_compiled import filter_check, filter_text

    for structure in (
        (1, (EFFECTS["disturbance"],)),
        (3, (EFFECTS["disturbance"],)),
        (1, tuple(EFFECTS.values())),
    ):
        kind = (structure, default_scheme(structure[0]).method, lanes())
        yield (
            f"n = {structure[0]}, {len(structure[1])} effects, width {lanes()}: filter",
            filter_text(*kind),
            filter_check(*kind),
        )


def loops() -> Iterator[Case]:
    """The closed loop of every kind of inputs."""
    from fish_train.training.closed_loop_equations import INPUT_COUNTS, Law
    from fish_train.training.compiled_loop import loop_check, loop_source

    for width in (1, lanes()):
        for inputs in INPUT_COUNTS:
            kind = (Stepper((3, ()), Scheme("rk4")), Law(inputs=inputs), width)
            yield (
                f"n = 3, rk4, width {width}: closed loop, {inputs}",
                loop_source(*kind),
                loop_check(*kind),
            )


def cases() -> Iterator[Case]:
    """Everything that can be built here."""
    yield from kernels()
    for kind in (filters, loops):
        try:
            yield from kind()
        except ImportError as error:
            print(f"left out: {kind.__name__} ({error})")


def preload() -> None:
    """Start again with the sanitizers' libraries, which have to be loaded before Python."""
    found = [
        subprocess.run(
            [compiler() or "cc", f"-print-file-name={name}"], capture_output=True, text=True
        ).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    # Python keeps memory at its end, which is no leak of a kernel
    os.environ.update(
        LD_PRELOAD=" ".join(found), ASAN_OPTIONS="detect_leaks=0", FISH_SIM_SANITIZED="1"
    )
    os.execv(sys.executable, [sys.executable, *sys.argv])


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--flags", help="compiler flags in place of -O1 and the sanitizers, such as --flags=-O3"
    )
    flags = parser.parse_args().flags
    cc = compiler()
    if cc is None:
        print("sanitize_kernels: no C compiler found; install gcc or set CC", file=sys.stderr)
        return 2
    if flags is None and "FISH_SIM_SANITIZED" not in os.environ:
        preload()
    os.environ.pop("LD_PRELOAD", None)  # the compiler runs without them
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, text, check) in enumerate(cases()):
            path = Path(folder) / f"{number}.so"
            compile_library(cc, text, SANITIZED if flags is None else tuple(flags.split()), path)
            error = largest(check(ctypes.CDLL(str(path))))
            wrong += error > TOLERANCE
            print(f"{error:9.1e}  {name}{'  WRONG' if error > TOLERANCE else ''}", flush=True)
    print(f"{number + 1} kernels, {wrong} wrong; tolerance {TOLERANCE:.0e}")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
