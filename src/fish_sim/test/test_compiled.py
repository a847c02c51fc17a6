"""Compiled kernels: cached, thread-safe, and dispensable."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fish_sim import compiled, step
from fish_sim.interpreted import InterpretedKernel
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper

SCHEME = Scheme("euler")


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
