# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compile C text once, check what the compiler made of it, cache both by content, load it.

A library is built in a folder of its own, checked there, and moved into the cache; its result follows as KEY.json. The
cache is safe for threads and processes. Without a C compiler `compiler()` is None and the caller runs the same
expressions in CasADi's virtual machine.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

Check = Callable[
    [ctypes.CDLL], Mapping[str, float]
]  # name of a result -> its largest relative error

CHECKED = 3  # counts up when a check becomes stricter: what an older one has passed is built again
TOLERANCE = 1e-9  # relative; a rounding error of a right kernel is below 1e-11
FLAGS = (
    "-march=native",
    "-fno-math-errno",
    "-freciprocal-math",
    "-fPIC",
    "-shared",
    "-std=gnu11",
    "-w",
)
# gcc's search for registers to spill grows with the square of what it considers: half of the time of a large kernel
FEW_SPILLS = ("--param", "lra-max-considered-reload-pseudos=30")
# tried in this order until a library computes what it should
OPTIMISATION = (("-O3", *FEW_SPILLS), ("-O3", "-fno-tree-vectorize", *FEW_SPILLS), ("-O1",))
# The loop vectoriser of gcc 12.2 for AVX-512 gets a scalar adjoint wrong, and it makes no kernel of one fish faster. gcc
# and clang both know the flag.
SCALAR_OPTIMISATION = OPTIMISATION[1:]
# Half of the compiler's time for a text with derivatives of several lanes, whose kernel is a twentieth slower.
DERIVATIVE_OPTIMISATION = (("-O2", *FEW_SPILLS), *OPTIMISATION)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Result:
    """What the check of a library said."""

    passed: bool
    flags: list[str]  # the level of optimisation
    errors: dict[str, float]  # largest relative errors by name
    sha256: str  # of the library that was checked

    @property
    def error(self) -> float:
        """The largest of all; one that is no number counts as infinite."""
        return largest(self.errors)


def compiler() -> str | None:
    """Path of the C compiler ($CC, else cc, gcc, clang), or None; FISH_SIM_NO_COMPILER=1 pretends there is none."""
    if os.environ.get("FISH_SIM_NO_COMPILER"):
        return None
    asked = os.environ.get("CC")
    found = (
        path for name in (asked, "cc", "gcc", "clang") if name and (path := shutil.which(name))
    )
    chosen = next(found, None)
    if asked and shutil.which(asked) is None:
        _say_unknown(asked, chosen)
    return chosen


@functools.cache
def _say_unknown(asked: str, chosen: str | None) -> None:
    """Once: what $CC names cannot be run."""
    log.warning("CC=%r is no program (flags cannot be given in it); %s is used", asked, chosen)


def cache_folder() -> Path:
    """$FISH_SIM_CACHE, else fish_sim under the user's cache folder."""
    base = os.environ.get("FISH_SIM_CACHE")
    if base:
        return Path(base)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fish_sim"


@functools.cache
def lanes() -> int:
    """Doubles in this processor's widest vector: 8, 4 or (anything not x86) 2."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return 2
    try:
        flags = Path("/proc/cpuinfo").read_text()
    except OSError:
        return 4
    return 8 if "avx512f" in flags else 4


@functools.cache
def has_libmvec() -> bool:
    """glibc's vector mathematics can be linked (x86-64 with glibc)."""
    try:
        ctypes.CDLL("libmvec.so.1")
    except OSError:
        return False
    return platform.machine() in ("x86_64", "AMD64")


def library(
    source: str, check: Check, width: int, derivatives: bool = False, quick: str = "-Og"
) -> ctypes.CDLL | None:
    """The loaded library for a C text of `width` lanes; None where the caller should use the interpreted form.

    derivatives: the text has tangents or adjoints, so that compiling it takes long. quick: the level of optimisation
    with FISH_SIM_QUICK_COMPILE=1 in the environment, for short runs of many structures, such as tests.

    A text that is not in the cache is compiled and its library given to `check`. One whose errors exceed TOLERANCE is
    compiled with safer flags; where none helps, or no compiler works, a warning says so.
    """
    cc = compiler()
    if cc is None:
        return None
    levels = _levels(width, derivatives, quick)
    key = _digest(
        "\n".join(
            [source, cc, _processor(), *FLAGS, str(levels), str(TOLERANCE), str(CHECKED)]
        ).encode()
    )
    try:
        folder = cache_folder().resolve()  # a name without a folder would be looked for elsewhere
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{key}.so"
        result = _cached(path) or _build(cc, source, check, levels, path)
        if result.passed:
            return ctypes.CDLL(str(path))
        log.warning(
            "no compiled kernel: what %s makes of the C text differs from the expressions by %.1e (allowed: %.0e)"
            " even with %s; the slower interpreted form is used",
            cc,
            result.error,
            TOLERANCE,
            " ".join(result.flags),
        )
    except (OSError, subprocess.CalledProcessError) as error:
        log.warning("no compiled kernel (%s); the slower interpreted form is used", _detail(error))
    return None


def _levels(width: int, derivatives: bool, quick: str) -> tuple[tuple[str, ...], ...]:
    if os.environ.get("FISH_SIM_QUICK_COMPILE"):
        return (quick, *FEW_SPILLS), ("-O1",)
    if width == 1:
        return SCALAR_OPTIMISATION
    return DERIVATIVE_OPTIMISATION if derivatives else OPTIMISATION


def compile_library(cc: str, source: str, flags: tuple[str, ...], path: Path) -> None:
    """Compile a C text into a shared library at `path`; its text stays in the same folder.

    Raises:
        subprocess.CalledProcessError: the compiler refuses the text or a flag; stderr holds its message.
    """
    text = path.with_suffix(".c")
    text.write_text(source)
    libraries = ["-lmvec"] if has_libmvec() else []
    command = [cc, *flags, *FLAGS, str(text), "-o", str(path), *libraries, "-lm"]
    subprocess.run(command, check=True, capture_output=True)


def largest(errors: Mapping[str, float]) -> float:
    """The largest error; one that is no number counts as infinite."""
    return max((np.inf if np.isnan(e) else e for e in errors.values()), default=0.0)


def _build(
    cc: str, source: str, check: Check, levels: tuple[tuple[str, ...], ...], path: Path
) -> Result:
    """Of the first level that passes, or of the last that compiles; its library stands at `path` afterwards.

    Raises:
        OSError, subprocess.CalledProcessError: no level gives a library that can be loaded.
    """
    best: tuple[Result, Path] | None = None
    failure: OSError | subprocess.CalledProcessError | None = None
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        for number, flags in enumerate(levels):
            built = Path(folder) / f"{number}.so"  # a path that was loaded once is not loaded again
            try:
                compile_library(cc, source, flags, built)
                errors = _errors(check, ctypes.CDLL(str(built)))
            except (OSError, subprocess.CalledProcessError) as error:
                failure = error
                log.info("no kernel compiled with %s: %s", " ".join(flags), _detail(error))
                continue
            passed = largest(errors) <= TOLERANCE
            best = Result(passed, list(flags), errors, _digest(built.read_bytes())), built
            if passed:
                break
            log.info("compiled with %s a kernel is wrong: %s", " ".join(flags), errors)
        if best is None:
            raise failure or ValueError("levels: got none; expected at least one")
        result, built = best
        record = Path(folder) / "result.json"
        record.write_text(json.dumps(asdict(result)))
        built.replace(path)
        record.replace(path.with_suffix(".json"))
    return result


def _errors(check: Check, loaded: ctypes.CDLL) -> dict[str, float]:
    """What a check says of a library; one without the kernel's functions is as wrong as can be."""
    try:
        return dict(check(loaded))
    except AttributeError as error:
        log.info("a library lacks a function: %s", error)
        return {"functions": np.inf}


def _detail(error: OSError | subprocess.CalledProcessError) -> str:
    """What the compiler said, in whatever language, or how it ended."""
    if isinstance(error, OSError):
        return str(error)
    said: str = error.stderr.decode(errors="replace")[:400].strip()
    return said or f"{error.cmd[0]} ended with status {error.returncode}"


def _cached(path: Path) -> Result | None:
    """The result of the check of this very library, or None: then it is not trusted."""
    try:
        result = Result(**json.loads(path.with_suffix(".json").read_text()))
        return result if result.sha256 == _digest(path.read_bytes()) else None
    except (FileNotFoundError, ValueError, TypeError):
        return None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:24]  # enough to tell any two apart


@functools.cache
def _processor() -> str:
    """Name and flags: a cache on a shared home folder must not serve another machine's vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "\n".join(sorted({line for line in lines if line.startswith(("model name", "flags"))}))
