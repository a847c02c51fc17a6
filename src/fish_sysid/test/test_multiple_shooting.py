# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Multiple shooting: known parameters come back, and its matrices and slopes are what they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import at_centre_of_mass
from fish_sysid.dataset.experiment import Experiment, Headings
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import (
    KNOWLEDGE_PRIOR,
    Parametrization,
    nominal_hypothesis,
)
from fish_sysid.estimation.shooting.least_squares import (
    Blocks,
    clustered_covariance,
    eliminate,
    scores_by_trial,
)
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.prediction_fit import with_links
from fish_sysid.estimation.shooting.residuals import SENSOR_SCALE, SENSORS, cut, regular_starts
from fish_sysid.estimation.shooting.rollout import (
    Directions,
    ShotParametrization,
    memories,
    poses_and_slopes,
)
from fish_sysid.estimation.shooting.start_states import shot_states

FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
NOISE = Noise(wrench=(5e-4, 1e-3, 3e-5))
NOMINAL = Robot(links=1)
TRUTH = NOMINAL.with_parameters(
    head_drag_surge=0.28,
    head_drag_yaw=2.2e-3,
    tail_stiffness=1.3 * NOMINAL.parameters["tail_stiffness"],
)


def recorded(
    truth: Robot = TRUTH,
    kinds: tuple[str, ...] = ("steps", "sines", "random"),
    duration: float = 10.0,
    imu_late: float = 0.0,
) -> tuple[Experiment, np.ndarray]:
    """(trials with the IMU's orientation, true states)."""
    random = np.random.default_rng(5)
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    made, true = record(truth, commands, NOISE, random)
    t = DT * np.arange(made.length)
    headings = tuple(
        Headings(t + imu_late, true.state[:, m, 2] + 0.7 * m) for m in range(len(kinds))
    )
    return replace(made, headings=headings), true.state


def shooting_on(experiment: Experiment, length: float = 2.0) -> Shooting:
    coordinates = ShotParametrization(nominal_hypothesis(NOMINAL, FREE))
    return Shooting(
        experiment,
        coordinates,
        cut(experiment, regular_starts(experiment, length, length, 1.0), length),
    )


def test_known_parameters_and_the_imu_s_clock_come_back() -> None:
    experiment, _ = recorded(imu_late=0.03)
    shooting = shooting_on(experiment)
    guess = shooting.settle(shooting.first_guess(shooting.coordinates.origin()))
    _, guess = shooting.fit(guess)
    found = shooting.coordinates.robot(guess.theta).parameters
    for name in FREE:
        assert found[name] == pytest.approx(TRUTH.parameters[name], rel=0.05)
    _, lead, offset, ahead = guess.sensors * SENSOR_SCALE
    assert lead == pytest.approx(0.03, abs=0.003)
    assert offset == pytest.approx(0.0, abs=0.01)
    assert ahead == pytest.approx(0.0, abs=0.003)


def test_the_camera_s_point_comes_back() -> None:
    """Of a camera that follows a point 3 cm behind the centre of mass."""
    experiment = at_centre_of_mass(recorded()[0], 0.03)
    shooting = shooting_on(experiment)
    guess = shooting.settle(shooting.first_guess(shooting.coordinates.origin()))
    _, guess = shooting.fit(guess)
    assert guess.sensors[3] * SENSOR_SCALE[3] == pytest.approx(-0.03, abs=0.003)


def test_slopes_are_the_tangents_of_the_motion() -> None:
    experiment, _ = recorded(kinds=("steps",), duration=6.0)
    shooting = shooting_on(experiment, 1.0)
    guess = shooting.first_guess(shooting.coordinates.origin() + 0.1)
    p, dp, _ = shooting.coordinates.filter_inputs(guess.theta)
    directions, stepper = Directions.of(p, dp), shooting.coordinates.stepper
    memory = memories(stepper, experiment, shooting.windows, directions)
    pose, slope = poses_and_slopes(stepper, shooting.windows, directions, memory, guess.x)
    start = np.concatenate([guess.x, memory[0]], axis=1)
    for j in range(len(dp)):
        value, tangent = stepper.rollout_jvp(
            start, shooting.windows.commands, p, np.zeros_like(start), np.zeros((1, 1, 2)), dp[j]
        )
        assert pose == pytest.approx(value[..., :3], abs=1e-12)
        size = np.abs(tangent[..., :3]).max()
        assert slope[..., j] == pytest.approx(tangent[..., :3], abs=1e-3 * size)


def test_eliminated_start_states_give_the_dense_solution() -> None:
    random, W, P, X = np.random.default_rng(0), 3, 4, 2
    J = random.normal(size=(W, 12, P + X))
    e = random.normal(size=(W, 12))
    blocks = Blocks(
        *(
            np.einsum("wri,wrj->wij", J[..., :P], J[..., :P]),
            np.einsum("wri,wr->wi", J[..., :P], e),
        ),
        *(
            np.einsum("wri,wrj->wij", J[..., :P], J[..., P:]),
            np.einsum("wri,wrj->wij", J[..., P:], J[..., P:]),
        ),
        np.einsum("wri,wr->wi", J[..., P:], e),
    )
    reduced = eliminate(blocks)
    dz = -np.linalg.solve(reduced.matrix.sum(0), reduced.gradient.sum(0))
    dense = np.zeros((W * 12, P + W * X))
    for w in range(W):
        dense[w * 12 : w * 12 + 12, :P] = J[w, :, :P]
        dense[w * 12 : w * 12 + 12, P + w * X : P + w * X + X] = J[w, :, P:]
    move = np.linalg.lstsq(dense, -e.ravel(), rcond=None)[0]
    assert dz == pytest.approx(move[:P])
    assert reduced.start_moves(dz).ravel() == pytest.approx(move[P:])


def test_errors_clustered_by_trial_are_those_of_a_bootstrap_over_trials() -> None:
    random, M, N = np.random.default_rng(1), 60, 15
    x = np.repeat(random.normal(size=(M, 1)), N, axis=1)
    y = 2.0 * x + random.normal(size=(M, 1)) + 0.1 * random.normal(size=(M, N))
    trial = np.repeat(np.arange(M), N)
    J = np.column_stack([x.ravel(), np.ones(M * N)])
    beta = np.linalg.lstsq(J, y.ravel(), rcond=None)[0]
    e, wide = J @ beta - y.ravel(), np.full(2, 1e6)
    scores = scores_by_trial(e, np.ones_like(e), J, trial)
    deviation = np.sqrt(np.diag(clustered_covariance(scores, J.T @ J, wide)))
    drawn = []
    for _ in range(400):
        runs = random.integers(0, M, M)
        rows = (runs[:, None] * N + np.arange(N)).ravel()
        drawn.append(np.linalg.lstsq(J[rows], y.ravel()[rows], rcond=None)[0])
    assert deviation == pytest.approx(np.std(drawn, axis=0), rel=0.2)
    independent = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * e.var())
    assert (deviation > 2.0 * independent).all()


def test_what_trials_do_not_tell_keeps_the_prior_s_width() -> None:
    scores = np.array([[1.0, 0.0], [-1.0, 0.0], [0.5, 0.0], [-0.5, 0.0]])
    normal = np.diag([50.0, 0.0]) + np.diag([1.0, 1.0 / 0.3**2])
    covariance = clustered_covariance(scores, normal, np.array([1.0, 0.3]))
    assert np.sqrt(covariance[1, 1]) == pytest.approx(0.3)


def test_states_by_the_past_second_are_the_true_ones() -> None:
    experiment, true = recorded()
    starts = np.array([[0, 400], [1, 600], [2, 800]])
    found = shot_states(experiment, TRUTH, starts)
    for row, (m, k) in zip(found, starts, strict=True):
        assert row[:2] == pytest.approx(true[k, m, :2], abs=0.003)
        assert row[2] == pytest.approx(true[k, m, 2], abs=0.01)
        assert row[4:6] == pytest.approx(true[k, m, 4:6], abs=0.01)


def test_a_start_without_a_second_before_it_has_no_state() -> None:
    experiment, _ = recorded(kinds=("steps",), duration=4.0)
    assert np.isnan(shot_states(experiment, TRUTH, np.array([[0, 50]]))).all()


def test_predictions_have_the_slopes_of_finite_differences_and_improve() -> None:
    experiment, _ = recorded(duration=9.0)
    coordinates = ShotParametrization(nominal_hypothesis(NOMINAL, FREE))
    starts = np.array([[m, k] for m in range(3) for k in (200, 300)])
    cost = Multistep(experiment, coordinates, starts)
    z = np.append(np.zeros(len(FREE) + len(SENSORS) - 1), 0.5)
    states = cost.states(z)
    e, J = cost.errors(z, states, slopes=True)
    for j in (0, 1, 2, 3, 5, 6):
        ahead, behind = z.copy(), z.copy()
        ahead[j] += 1e-4
        behind[j] -= 1e-4
        slope = (cost.errors(ahead, states)[0] - cost.errors(behind, states)[0]) / 2e-4
        assert J[..., j] == pytest.approx(slope, abs=2e-3 * max(np.abs(slope).max(), 1.0))
    reached, found = cost.improve(z)
    assert reached < 0.2 * cost.total(z, e)
    robot = coordinates.robot(found[:3])
    assert robot.parameters["head_drag_surge"] == pytest.approx(0.28, rel=0.1)


def test_slopes_are_used_for_more_than_one_step() -> None:
    """From slopes at one point the cost falls further than by the best damped step that they give."""
    experiment, _ = recorded(kinds=("steps", "sines"), duration=9.0)
    coordinates = ShotParametrization(nominal_hypothesis(NOMINAL, FREE))
    cost = Multistep(experiment, coordinates, np.array([[m, 200] for m in range(2)]))
    z = np.zeros(len(FREE) + len(SENSORS))
    states = cost.states(z)
    e, J = cost.errors(z, states, slopes=True)
    gradient, normal = cost.normal(z, e, J)
    by_one_step = []
    for damping in (1e-2, 1e-1, 1.0, 10.0):
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        step[cost.imu_clock] = 0.0
        tried = cost.clip(z + np.clip(step, -0.5, 0.5))
        by_one_step.append(cost.total(tried, cost.errors(tried, states)[0]))
    found = cost.minimise(z, states, 1)
    assert cost.total(found, cost.errors(found, states)[0]) < min(by_one_step)


def test_the_prior_is_as_wide_as_what_is_known() -> None:
    robot = replace(
        NOMINAL, knowledge={"head_drag_surge": "measured", "head_drag_yaw": "estimated"}
    )
    coordinates = ShotParametrization(nominal_hypothesis(robot, FREE))
    expected = [KNOWLEDGE_PRIOR[word] for word in ("measured", "estimated", "unknown")]
    assert coordinates.prior.tolist() == expected


def test_a_tail_of_another_number_of_links_keeps_its_total() -> None:
    stiff = Robot(links=3).with_parameters(link_mass=2.0 * 0.05 / 3)
    one = with_links(stiff, 1)
    assert one.links == 1
    assert one.parameters["link_mass"] == pytest.approx(0.1)
    assert Parametrization(nominal_hypothesis(one, ("link_mass",))).origin() == pytest.approx(0.0)
