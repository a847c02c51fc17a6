# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The equations against a Lagrangian derived by automatic differentiation, and their conservation laws."""

from types import SimpleNamespace

import numpy as np
import pytest
from lagrangian import accelerations, kinetic_energy, momentum, spring_energy
from scipy.integrate import solve_ivp
from torch import tensor

from fish_sim.dynamics import SLIP_DECAY, energy
from fish_sim.model import Layout, motion_rate, motion_solution
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.step import Stepper

DRAGS = (
    "head_drag_surge head_drag_sway head_drag_yaw link_drag_surge link_drag_sway fin_drag_surge fin_drag_sway"
).split()


def drag_free(links=3):
    return Robot(links=links).with_parameters(**dict.fromkeys(DRAGS, 0.0))


def random_motion(links, seed):
    random = np.random.default_rng(seed)
    q = np.concatenate(
        [random.uniform(-1, 1, 2), random.uniform(-3, 3) + random.uniform(-0.8, 0.8, links + 1)]
    )
    return q, random.normal(size=links + 3) * 0.5


@pytest.mark.parametrize("links", [1, 2, 3, 5])
@pytest.mark.parametrize("share", [0.0, 0.4])
def test_accelerations_and_tip_force_are_those_of_the_lagrangian(links, share):
    robot = Robot(links=links)
    if share:
        robot = robot.with_effect("rudder_placement", tip_share=share)
    layout = Layout(robot.structure)
    for seed in range(2):
        q, qd = random_motion(links, seed)
        drive = (0.3, -1.7, 60.0, 900.0)
        ours = motion_solution(layout, [*q, *qd], drive, robot.vector(), NUMPY)
        qdd, force = accelerations(q, qd, 0.3, -1.7, 900.0, robot.parameters, share, SLIP_DECAY)
        np.testing.assert_allclose(ours.acceleration, qdd, rtol=1e-9, atol=1e-9 * np.abs(qdd).max())
        assert ours.tip_force == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("links", [1, 3])
def test_energy_is_that_of_the_lagrangian(links):
    r = Robot(links=links).parameters
    q, qd = random_motion(links, 7)
    expected = kinetic_energy(tensor(q), tensor(qd), tensor(0.2), tensor(0.0), r) + spring_energy(
        tensor(q), 0.2, r
    )
    assert energy(q, qd, 0.2, SimpleNamespace(**r), NUMPY) == pytest.approx(
        float(expected), rel=1e-12
    )


@pytest.mark.parametrize(
    ("links", "scheme", "per_second"),
    [(3, None, 5e-7), (3, Scheme("dop853", 2), 5e-8), (1, None, 1e-9)],
)
def test_energy_without_drag_and_drive_is_constant(links, scheme, per_second):
    robot = drag_free(links)
    stepper = Stepper.of(robot, scheme)
    start = stepper.rest(rudder=0.2)
    size = 3 + links
    start[2:size] = (0.1, 0.2, 0.3, 0.5)[: links + 1]
    start[size : size + 2] = (
        0.2 * np.cos(start[size - 1]),
        0.2 * np.sin(start[size - 1]),
    )  # the tip does not slip
    commands = np.tile([0.0, 0.2], (1000, 1))
    states = stepper.rollout(start, commands, stepper.parameters(robot))
    q, qd = states[:, :size].T, states[:, size : 2 * size].T
    E = energy(q, qd, 0.2, SimpleNamespace(**robot.parameters), NUMPY)
    assert np.abs(E[100:] / E[0] - E[:-100] / E[0]).max() < per_second
    assert np.ptp(states[:, size - 1]) > 0.3
    assert E[0] > 0.005


def test_the_tip_does_not_slip_while_swimming(strokes):
    robot = Robot()
    stepper = Stepper.of(robot)
    commands = strokes(500)
    states = stepper.rollout(stepper.rest(), commands, stepper.parameters(robot))
    slip = stepper.outputs(states, np.zeros(2), stepper.parameters(robot))["slip"]
    assert np.abs(slip).max() < 1e-5
    assert np.linalg.norm(states[-1, :2]) > 0.3


def test_momentum_is_conserved_with_the_constraint_off():
    robot = drag_free()
    layout = Layout(robot.structure)
    q, qd = random_motion(3, 11)
    p = robot.vector()

    def rate(_, x):
        return [
            *x[6:],
            *motion_solution(layout, x, (0.3, 0.0, 0.0, 0.0), p, NUMPY, False).acceleration,
        ]

    run = solve_ivp(
        rate, (0.0, 0.15), np.concatenate([q, qd]), method="DOP853", rtol=1e-10, atol=1e-12
    )
    linear, angular = zip(*(momentum(x[:6], x[6:], robot.parameters) for x in run.y.T), strict=True)
    np.testing.assert_allclose(linear, np.tile(linear[0], (len(linear), 1)), rtol=1e-8)
    np.testing.assert_allclose(angular, angular[0], rtol=1e-8)
    assert np.ptp(run.y[5]) > 0.1  # the tail moved meanwhile


def test_rate_of_the_motion_vector_is_velocity_then_acceleration():
    robot = Robot()
    q, qd = random_motion(3, 13)
    drive = (0.1, 0.0, 0.0, 500.0)
    rate = motion_rate(Layout(robot.structure), [*q, *qd], drive, robot.vector(), NUMPY)
    np.testing.assert_array_equal(rate[:6], qd)
    qdd, _ = accelerations(q, qd, 0.1, 0.0, 500.0, robot.parameters, 0.0, SLIP_DECAY)
    np.testing.assert_allclose(rate[6:12], qdd, rtol=1e-9, atol=1e-9 * np.abs(qdd).max())
