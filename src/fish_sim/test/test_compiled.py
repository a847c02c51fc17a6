# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: cached, thread-safe, and dispensable."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fish_sim import compiled, step
from fish_sim.interpreted import InterpretedKernel
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper

SCHEME = Scheme("euler")

pytestmark = pytest.mark.usefixtures("shipped_flags")


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """An empty cache on disk and in memory."""
    monkeypatch.setenv("FISH_SIM_CACHE", str(tmp_path))
    step.kernel.cache_clear()
    yield tmp_path
    step.kernel.cache_clear()


def swim(strokes, batch=1):
    robot = Robot(links=1)
    stepper = Stepper(robot.structure, SCHEME)
    start = np.tile(stepper.rest(), (batch, 1))
    return stepper.rollout(start, strokes(20), stepper.parameters(robot))


def test_without_a_compiler_the_same_numbers_come(fresh, monkeypatch, strokes):
    with_compiler = swim(strokes)
    step.kernel.cache_clear()
    monkeypatch.setenv("FISH_SIM_NO_COMPILER", "1")
    assert compiled.compiler() is None
    np.testing.assert_allclose(swim(strokes), with_compiler, rtol=1e-8, atol=1e-12)


def test_a_broken_compiler_is_said_and_done_without(fresh, monkeypatch, caplog, strokes):
    monkeypatch.setenv("CC", "false")
    expected = np.asarray(swim(strokes))
    assert "no compiled kernel" in caplog.text
    assert not list(fresh.glob("*.so"))
    assert isinstance(Stepper((1, ()), SCHEME)._kernel(1), InterpretedKernel)
    assert np.isfinite(expected).all()


def test_a_compiler_with_arguments_is_said_and_the_usual_one_taken(fresh, monkeypatch, caplog):
    monkeypatch.setenv("CC", "gcc -O0")
    compiled._say_unknown.cache_clear()
    assert compiled.compiler() == next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))))
    assert compiled.compiler()
    assert caplog.text.count("CC='gcc -O0' is no program") == 1


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("printf 'ung\\374ltig' >&2; exit 1", "ung"),  # a message in Latin-1
        ("kill -9 $$", "ended with status -9"),
        ("for a; do case $a in *.so) : > $a;; esac; done", "too short"),
    ],
)
def test_whatever_becomes_of_a_compiler_the_user_is_told(
    fresh, monkeypatch, caplog, strokes, script, said
):
    cc = fresh / "cc"
    cc.write_text(f"#!/bin/sh\n{script}\n")
    cc.chmod(0o755)
    monkeypatch.setenv("CC", str(cc))
    assert np.isfinite(swim(strokes)).all()
    assert said in caplog.text
    assert not list(fresh.glob("*.so"))


@pytest.mark.skipif(compiled.compiler() is None, reason="no C compiler on this computer")
def test_a_compiler_that_fails_with_the_fast_flags_is_given_safer_ones(
    fresh, monkeypatch, caplog, strokes
):
    cc = fresh / "cc"
    gcc = compiled.compiler()
    cc.write_text(f'#!/bin/sh\ncase " $* " in *" -O3 "*) exit 4;; esac\nexec {gcc} "$@"\n')
    cc.chmod(0o755)
    monkeypatch.setenv("CC", str(cc))
    assert np.isfinite(swim(strokes)).all()
    (result,) = fresh.glob("*.json")
    assert json.loads(result.read_text())["flags"] == ["-O1"]
    assert not caplog.text


@pytest.mark.skipif(compiled.compiler() is None, reason="no C compiler on this computer")
def test_the_cache_may_be_the_current_folder(fresh, monkeypatch, caplog, strokes):
    monkeypatch.chdir(fresh)
    monkeypatch.setenv("FISH_SIM_CACHE", ".")
    assert np.isfinite(swim(strokes)).all()
    assert not caplog.text


def test_a_folder_that_cannot_be_written_is_said_and_done_without(
    fresh, monkeypatch, caplog, strokes
):
    (fresh / "file").write_text("not a folder")
    monkeypatch.setenv("FISH_SIM_CACHE", str(fresh / "file"))
    assert np.isfinite(swim(strokes)).all()
    assert "no compiled kernel" in caplog.text


@pytest.mark.skipif(compiled.compiler() is None, reason="no C compiler on this computer")
def test_a_kernel_is_compiled_once_and_then_taken_from_the_cache(fresh, monkeypatch, strokes):
    first = swim(strokes)
    built = {path: path.stat().st_mtime_ns for path in fresh.glob("*.so")}
    assert len(built) == 1
    step.kernel.cache_clear()
    monkeypatch.setattr(compiled, "compile_library", lambda *_: pytest.fail("compiled again"))
    np.testing.assert_array_equal(swim(strokes), first)
    assert {path: path.stat().st_mtime_ns for path in fresh.glob("*.so")} == built


def test_threads_share_a_kernel(strokes):
    alone = swim(strokes, batch=16)
    with ThreadPoolExecutor(8) as pool:
        for states in pool.map(lambda _: swim(strokes, batch=16), range(32)):
            np.testing.assert_array_equal(states, alone)
