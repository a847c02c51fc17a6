# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: the same numbers as the reference, at every width of vectors."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from fish_sim import compiled, step, torch_step
from fish_sim.effects import EFFECTS
from fish_sim.interpreted import InterpretedKernel
from fish_sim.kernel import CompiledKernel
from fish_sim.kernel_source import PARTS
from fish_sim.methods import METHODS
from fish_sim.robot import Robot
from fish_sim.self_check import random_parameters, random_states
from fish_sim.step import Scheme, Stepper, kernel

pytestmark = pytest.mark.usefixtures("shipped_flags")


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


PERIODS = 3
ACTING = (EFFECTS["wake_memory"], EFFECTS["rudder_lag"])  # a state of the motion, a memory
COMPILERS = [
    pytest.param(
        name, marks=pytest.mark.skipif(not shutil.which(name), reason=f"no {name} on this computer")
    )
    for name in ("gcc", "clang")
]


@pytest.fixture
def compiler(request, monkeypatch):
    monkeypatch.delenv("FISH_SIM_NO_COMPILER", raising=False)
    monkeypatch.setenv("CC", request.param)
    kernel.cache_clear()
    yield request.param
    kernel.cache_clear()


def both(structure, scheme=None):
    """The compiled stepper, every part of which is, and the interpreted one."""
    steppers = [Stepper(structure, scheme, compiled) for compiled in (True, False)]
    assert all(
        isinstance(steppers[0]._kernel(batch, part), CompiledKernel)
        for batch in (1, 2)
        for part in PARTS
    )
    return steppers


def assert_equal(found, right):
    """To 1e-9 of the largest of each component."""
    found, right = (np.reshape(a, (-1, np.shape(a)[-1])) for a in (found, right))
    scale = np.abs(right).max(axis=0)
    np.testing.assert_array_less(
        np.abs(found - right).max(axis=0), 1e-9 * np.maximum(scale, 1e-3 * scale.max())
    )


def fish(layout, batch, random, shared):
    """States at the instants of a rollout, commands, parameters; shared: one row of both for all fish."""
    states = random_states(layout, (PERIODS + 1, batch), random)
    rows = () if shared else (batch,)
    commands = random.uniform(-1.0, 1.0, (PERIODS, *rows, 2)) * [100.0, 0.3]
    parameters = random_parameters(layout, batch, random)
    return states, commands, parameters[0] if shared else parameters


@pytest.mark.parametrize("compiler", COMPILERS, indirect=True)
@pytest.mark.parametrize("method", METHODS)
def test_compiled_and_interpreted_agree_at_every_batch(method, compiler):
    compiled, interpreted = both((1, ACTING), Scheme(method))
    random = np.random.default_rng(7)
    for batch in range(1, 18):
        states, commands, p = fish(compiled.layout, batch, random, shared=batch % 3 == 0)
        ds, dc, dp = (random.normal(size=np.shape(a)) for a in (states[0], commands, p))
        dc, dp = dc * [50.0, 0.2], dp * p
        g = random.normal(size=states.shape)
        for results in zip(
            *(
                (
                    s.rollout(states[0], commands, p)[1:],
                    *(a[1:] for a in s.rollout_jvp(states[0], commands, p, ds, dc, dp)),
                    *s.rollout_vjp(states, commands, p, g),
                    s.memory_jvp(
                        states[0][:, len(s.layout.motion) :],
                        np.broadcast_to(commands.reshape(PERIODS, -1, 2), (PERIODS, batch, 2)),
                        p,
                        dp,
                    )[1],
                )
                for s in (compiled, interpreted)
            ),
            strict=True,
        ):
            assert_equal(*results)


@pytest.mark.parametrize("compiler", COMPILERS, indirect=True)
def test_the_nominal_robot_alone_agrees_over_a_second(compiler, strokes):
    compiled, interpreted = both(Robot().structure)
    p, commands = compiled.parameters(Robot()), strokes(100)
    states = interpreted.rollout(interpreted.rest(), commands, p)
    np.testing.assert_allclose(
        compiled.rollout(compiled.rest(), commands, p), states, rtol=1e-7, atol=1e-9
    )
    g = np.zeros_like(states)
    g[-1, 0] = 1.0
    for found, right in zip(
        *(s.rollout_vjp(states, commands, p, g) for s in (compiled, interpreted)), strict=True
    ):
        assert_equal(found, right)


@pytest.mark.parametrize("compiler", COMPILERS, indirect=True)
def test_torch_gradients_of_one_fish_without_a_batch_axis_equal_finite_differences(
    compiler, strokes
):
    stepper, _ = both(Robot().structure)
    layout, commands = stepper.layout, strokes(40)
    p = stepper.parameters(Robot())
    start = random_states(layout, (), np.random.default_rng(8))
    values = [torch.tensor(v, requires_grad=True) for v in (start, commands, p)]
    weights = np.random.default_rng(9).normal(size=start.shape)
    (torch_step.rollout(*values, stepper)[-1] * torch.from_numpy(weights)).sum().backward()

    def loss(**changed):
        given = {"start": start, "commands": commands, "parameters": p} | changed
        return stepper.rollout(**given)[-1] @ weights

    directions = [("start", start, k) for k in range(len(start))] + [
        ("parameters", p, k) for k in range(len(p))
    ]
    gradients = {"start": values[0].grad.numpy(), "parameters": values[2].grad.numpy()}
    for name, at, k in directions:
        h = 1e-4 * max(abs(at[k]), 1e-3)
        steps = h * np.eye(len(at))[k]
        last = [loss(**{name: at + factor * steps}) for factor in (-2, -1, 1, 2)]
        difference = (last[0] - 8 * last[1] + 8 * last[2] - last[3]) / (12 * h)
        noise = 1e-12 / h  # of round-off
        gradient = gradients[name][k]
        assert abs(gradient - difference) <= 1e-6 * abs(difference) + noise, (
            f"{name} {k}: {gradient}, {difference}"
        )
