# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cost of a kernel's self-check as a share of the cost of its build, in processor time.

    python benchmarks/self_check_cost.py
    python benchmarks/self_check_cost.py --links 12

Builds every part of a kernel as the cache does, at one lane and at a whole vector, for robots of 1, 3, 5 and 12 links and
for one link with every effect, then the filter and the closed loop where they are installed. The build is the compiler's
processor time, the check is this process's. Prints both for each kernel, and the share of the check in all of them.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import resource
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from sanitize_kernels import Case, filters, loops

from fish_sim.compiled import OPTIMISATION, SCALAR_OPTIMISATION, compile_library, compiler, lanes
from fish_sim.effects import EFFECTS
from fish_sim.kernel_source import PARTS, kernel_source
from fish_sim.model import Structure, functions
from fish_sim.scheme import default_scheme
from fish_sim.self_check import kernel_errors

STRUCTURES: tuple[Structure, ...] = (
    (1, ()),
    (3, ()),
    (5, ()),
    (12, ()),
    (1, tuple(EFFECTS.values())),
)


def kernels(structures: tuple[Structure, ...]) -> Iterator[Case]:
    """Every part of the kernel of each structure, with its default integrator."""
    for structure in structures:
        functions(structure)  # CasADi's expressions serve the build and the check
        scheme = default_scheme(structure[0])
        for width in (1, lanes()):
            for part in PARTS:
                name = f"n = {structure[0]}, {len(structure[1])} effects, width {width}: {part}"
                check = partial(kernel_errors, structure, scheme, width, part)
                yield name, kernel_source(structure, scheme, width, part), check


def compiler_seconds() -> float:
    """Processor time of the child processes that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def first_gradient() -> None:
    """Torch's first gradient in a process loads what all later ones use: it is no part of a check."""
    if importlib.util.find_spec("torch") is None:
        return
    import torch

    torch.ones(2, requires_grad=True).exp().sum().backward()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--links", type=int, help="only the kernels of a robot of so many links")
    links = parser.parse_args().links
    cc = compiler()
    if cc is None:
        print("self_check_cost: no C compiler found; install gcc or set CC")
        return 2
    first_gradient()
    total_build = total_check = 0.0
    cases = [kernels(STRUCTURES if links is None else ((links, ()),))]
    if links is None:
        cases += [filters(), loops()]
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, text, check) in enumerate(case for some in cases for case in some):
            path = Path(folder) / f"{number}.so"
            level = (SCALAR_OPTIMISATION if "width 1:" in name else OPTIMISATION)[0]
            before = compiler_seconds()
            compile_library(cc, text, level, path)
            build = compiler_seconds() - before
            start = time.process_time()
            check(ctypes.CDLL(str(path)))
            seconds = time.process_time() - start
            total_build += build
            total_check += seconds
            print(
                f"build {build:7.2f} s   check {seconds:6.2f} s   {seconds / build:6.1%}   {name}",
                flush=True,
            )
    print(
        f"all: {total_check:.1f} s of checks, {total_build:.1f} s of builds: {total_check / total_build:.1%}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
