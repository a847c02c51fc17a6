# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Derivatives against finite differences for every parameter of the robot and of every effect."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from fish_sim import torch_step
from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot, parameter_names
from fish_sim.step import Stepper

PERIODS = 40
MOVING = (0.3, 0.85, 0.1)


def typical(name):
    return {
        key: p.typical if p.typical is not None else p.value
        for key, p in EFFECTS[name].parameters.items()
    }


def finite_difference(stepper, start, commands, p, k):
    """d(last state)/dp[k], central differences of fourth order."""
    h = 1e-4 * max(abs(p[k]), 1e-3)
    shifted = np.tile(p, (4, 1))
    shifted[:, k] += h * np.array([-2, -1, 1, 2])
    last = stepper.rollout(start, commands, shifted)[-1]
    return (last[0] - 8 * last[1] + 8 * last[2] - last[3]) / (
        12 * h
    ), 1e-13 / h  # and its round-off


def tangents(stepper, start, commands, p, indices):
    """d(last state)/dp[k] for every k, by one batched JVP."""
    directions = np.zeros((len(indices), len(p)))
    directions[np.arange(len(indices)), indices] = 1.0
    zeros = np.zeros_like(commands)
    _, d = stepper.rollout_jvp(start, commands, p, np.zeros_like(start), zeros, directions)
    return d[-1]


def gentle(commands):
    """The same rotor with a rudder that the servo can follow."""
    rudder = 0.35 * np.sin(8.0 * 0.01 * np.arange(1, len(commands) + 1))
    return np.stack([commands[:, 0], rudder], axis=-1)


def case(effects, links=3):
    robot = Robot(links=links, effects=effects)
    stepper = Stepper(robot.structure, compiled=False)
    start = stepper.rest(MOVING)
    size = 3 + links
    start[size : 2 * size] = (0.2, 0.03, 0.1, 0.3, 0.5, 0.4)[
        :size
    ]  # moving, so that no |u| u sits on its kink
    return stepper, start, stepper.parameters(robot)


@pytest.mark.parametrize("name", ["nominal", *EFFECTS])
def test_tangents_equal_finite_differences_and_adjoints_equal_tangents(name, strokes):
    stepper, start, p = case({}) if name == "nominal" else case({name: typical(name)}, links=1)
    names = parameter_names(stepper.layout.structure)
    indices = [k for k, n in enumerate(names) if name == "nominal" or n.startswith(name + ".")]
    # steps reach the servo's rate limit, a nominal parameter; gentle turns let servo effects show
    commands = strokes(PERIODS) if name == "nominal" else gentle(strokes(PERIODS))
    forward = tangents(stepper, start, commands, p, indices)
    for k, tangent in zip(indices, forward, strict=True):
        difference, noise = finite_difference(stepper, start, commands, p, k)
        error = np.abs(tangent - difference).max()
        assert error <= 1e-6 * np.abs(difference).max() + noise, f"{names[k]}: {error}"
        assert name == "nominal" or np.abs(tangent).max() > 1e-5, f"{names[k]} has no influence"
    states = stepper.rollout(start, commands, p)
    weights = np.random.default_rng(1).normal(size=start.size)
    adjoint = np.zeros_like(states)
    adjoint[-1] = weights
    gradient = stepper.rollout_vjp(states, commands, p, adjoint)[2]
    assert_allclose(gradient[indices], forward @ weights, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "inwards", "ramp"), [("rudder_delay", 1e-5, 0.1), ("rudder_backlash", 1e-6, 0.0)]
)
def test_at_the_end_of_its_range_a_parameter_has_the_slope_towards_the_inside(
    name, inwards, ramp, strokes
):
    """Searches stand there: half of the slope, as of a kink in mid-range, would lead them and all others astray."""
    stepper, start, p = case({name: {}}, links=1)
    (k,) = (
        i
        for i, n in enumerate(parameter_names(stepper.layout.structure))
        if n.startswith(name + ".")
    )
    t = 0.01 * np.arange(PERIODS)
    commands = np.column_stack([strokes(PERIODS)[:, 0], 0.1 + ramp * t])
    (tangent,) = tangents(stepper, start, commands, p, [k])
    q = p.copy()
    q[k] += inwards
    difference = (
        stepper.rollout(start, commands, q)[-1] - stepper.rollout(start, commands, p)[-1]
    ) / inwards
    assert np.abs(tangent - difference).max() < 1e-3 * np.abs(difference).max()


def test_tangents_along_start_and_commands_equal_finite_differences(strokes):
    stepper, start, p = case({"tip_slip": typical("tip_slip"), "rudder_lag": typical("rudder_lag")})
    commands = strokes(PERIODS)
    random = np.random.default_rng(2)
    ds, dc = random.normal(size=start.shape), random.normal(size=commands.shape) * [10.0, 0.1]
    _, tangent = stepper.rollout_jvp(start, commands, p, ds, dc, np.zeros_like(p))
    h = 1e-6
    plus = stepper.rollout(start + h * ds, commands + h * dc, p)[-1]
    minus = stepper.rollout(start - h * ds, commands - h * dc, p)[-1]
    difference = (plus - minus) / (2 * h)
    assert np.abs(tangent[-1] - difference).max() < 1e-6 * np.abs(difference).max()


def test_torch_gradients_are_those_of_the_adjoint(strokes):
    stepper, start, p = case(
        {"wall_effect": typical("wall_effect"), "rudder_delay": typical("rudder_delay")}
    )
    values = [torch.tensor(v, requires_grad=True) for v in (start, strokes(10), p)]
    states = torch_step.rollout(*values, stepper)
    weights = torch.randn(
        states.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(3)
    )
    (states * weights).sum().backward()
    expected = stepper.rollout_vjp(states.detach().numpy(), strokes(10), p, weights.numpy())
    for value, gradient in zip(values, expected, strict=True):
        assert_allclose(value.grad.numpy(), gradient, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("lead", "batch"),
    [((3,), ()), ((4,), ()), ((2, 3), ()), ((2, 3), (3,)), ((4, 3), (3,)), ((2, 3), (1, 3))],
)
def test_commands_that_a_batch_shares_collect_the_gradients_of_all(strokes, lead, batch):
    """4 periods: a batch axis may be as long as the time's, and is none of it."""
    stepper, start, p = case({}, links=1)
    random = torch.Generator().manual_seed(4)
    starts = torch.tensor(start).repeat(*lead, 1)
    starts += 0.1 * torch.randn(starts.shape, dtype=torch.float64, generator=random)
    commands = torch.tensor(strokes(4)).reshape(4, *[1] * len(batch), 2).repeat(1, *batch, 1)
    commands += 0.1 * torch.randn(commands.shape, dtype=torch.float64, generator=random)
    weights = torch.randn(5, *lead, len(start), dtype=torch.float64, generator=random)
    gradients = {}
    for generic in (True, False):
        values = [v.clone().requires_grad_() for v in (starts, commands, torch.tensor(p))]
        (torch_step.rollout(*values, stepper, generic=generic) * weights).sum().backward()
        gradients[generic] = [v.grad for v in values]
    for one, other in zip(gradients[True], gradients[False], strict=True):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-10)


def test_gradcheck_of_a_short_rollout(strokes):
    stepper, start, p = case({"quadratic_drag": typical("quadratic_drag")})
    values = [torch.tensor(v, requires_grad=True) for v in (start, strokes(2), p)]
    assert torch.autograd.gradcheck(
        lambda s, c, q: torch_step.rollout(s, c, q, stepper)[-1],
        values,
        eps=1e-6,
        atol=1e-5,
        rtol=1e-5,
    )


def test_one_row_of_command_tangents_stands_for_all():
    stepper = Stepper.of(Robot())
    p, start, commands = stepper.parameters(Robot()), stepper.rest(), np.full((7, 2), 0.3)
    one, all_ = (
        stepper.rollout_jvp(
            start, commands, p, np.zeros_like(start), np.ones((rows, 2)), np.zeros_like(p)
        )[1]
        for rows in (1, 7)
    )
    np.testing.assert_array_equal(one, all_)
