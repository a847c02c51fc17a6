# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Values, tangents and adjoints: compiled against interpreted at every batch up to 17, of every integrator and compiler."""

import shutil

import numpy as np
import pytest
import torch

from fish_sim import torch_step
from fish_sim.effects import EFFECTS
from fish_sim.kernel import CompiledKernel
from fish_sim.kernel_source import PARTS
from fish_sim.methods import METHODS
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.self_check import random_parameters, random_states
from fish_sim.step import Stepper, kernel

PERIODS = 3
ACTING = (EFFECTS["wake_memory"], EFFECTS["rudder_lag"])  # a state of the motion, a memory
COMPILERS = [
    pytest.param(
        name, marks=pytest.mark.skipif(not shutil.which(name), reason=f"no {name} on this computer")
    )
    for name in ("gcc", "clang")
]

pytestmark = pytest.mark.usefixtures("shipped_flags")


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
