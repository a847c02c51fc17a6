"""Compile C text once, cache it by its content, load it.

The cache is safe for threads and processes: a library is built under a temporary name and moved into place. Without a
C compiler `compiler()` is None and the caller runs the same expressions in CasADi's virtual machine.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

FLAGS = (
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-freciprocal-math",
    "-fPIC",
    "-shared",
    "-std=gnu11",
    "-w",
)

log = logging.getLogger(__name__)


def compiler() -> str | None:
    """Path of the C compiler ($CC, else cc, gcc, clang), or None; FISH_SIM_NO_COMPILER=1 pretends there is none."""
    if os.environ.get("FISH_SIM_NO_COMPILER"):
        return None
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (path := shutil.which(name)):
            return path
    return None


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


def library(source: str) -> ctypes.CDLL | None:
    """The loaded library for a C text, compiled if it is not in the cache; None without a working compiler."""
    cc = compiler()
    if cc is None:
        return None
    key = hashlib.sha256("\n".join([source, cc, _processor(), *FLAGS]).encode()).hexdigest()[:24]
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{key}.so"
        if not path.exists():
            _compile(cc, source, path)
        return ctypes.CDLL(str(path))
    except (OSError, subprocess.CalledProcessError) as error:
        detail = (
            error.stderr.decode()[:400]
            if isinstance(error, subprocess.CalledProcessError)
            else error
        )
        log.warning("no compiled kernel (%s); the slower interpreted form is used", detail)
        return None


@functools.cache
def _processor() -> str:
    """Name and flags: a cache on a shared home folder must not serve another machine's vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return "\n".join(sorted({line for line in lines if line.startswith(("model name", "flags"))}))


def _compile(cc: str, source: str, path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        text, built = Path(folder) / "kernel.c", Path(folder) / "kernel.so"
        text.write_text(source)
        libraries = ["-lmvec"] if has_libmvec() else []
        command = [cc, *FLAGS, str(text), "-o", str(built), *libraries, "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        built.replace(path)
