# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tests of all packages have in common: one thread for each, and fixtures that several use."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

# Matrices here are small: a second thread only waits for the first, and takes the processor from other processes.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(
        name, "1"
    )  # read when NumPy is imported, and by processes that a test starts
# A test needs few steps of many structures. It also holds for processes that a test starts.
QUICK = "FISH_SIM_QUICK_COMPILE"
os.environ.setdefault(QUICK, "1")
KEPT_KERNELS = (
    ("fish_sim.step", "kernel"),
    ("fish_sysid.estimation.ekf_compiled", "filter_library"),
)


@pytest.fixture
def shipped_flags() -> Iterator[None]:
    """For tests of the kernels themselves: they are compiled as for users, and none is kept from another test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(QUICK, raising=False)
        _forget_kernels()
        yield
    _forget_kernels()


def _forget_kernels() -> None:
    for name, cached in KEPT_KERNELS:
        if name in sys.modules:
            getattr(sys.modules[name], cached).cache_clear()


@pytest.fixture
def wrong_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], None]:
    """wrong_compiler(edit): from then on gcc edits every text by this command of sed; the cache of kernels is empty."""

    def install(edit: str) -> None:
        gcc = shutil.which("gcc")
        if gcc is None:
            pytest.skip("no gcc on this computer")
        script = tmp_path / "wrong_cc"
        change = f"for a; do case $a in *.c) sed -i '{edit}' \"$a\";; esac; done"
        script.write_text(f'#!/bin/sh\n{change}\nexec {gcc} "$@"\n')
        script.chmod(0o755)
        monkeypatch.setenv("CC", str(script))
        monkeypatch.setenv("FISH_SIM_CACHE", str(tmp_path / "cache"))
        monkeypatch.delenv("FISH_SIM_NO_COMPILER", raising=False)
        monkeypatch.setenv(QUICK, "1")  # the text is wrong with any flags, and these are the fewest

    return install
