# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Multiple shooting, and effects chosen by predictions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import at_centre_of_mass
from fish_sysid.dataset.experiment import Experiment, Frames, Headings, joined
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
from fish_sysid.estimation.shooting.left_out import (
    LEVEL,
    converged,
    fold_steps,
    judged,
    left_out_costs,
)
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.multistep import LARGEST_STEP, Multistep
from fish_sysid.estimation.shooting.prediction_fit import (
    NORMAL,
    fit_predictions,
    inside,
    missed,
    other_links,
    prediction_hypothesis,
    uncertainty,
    with_links,
)
from fish_sysid.estimation.shooting.residuals import SENSOR_SCALE, SENSORS, cut, regular_starts
from fish_sysid.estimation.shooting.rollout import (
    ShotParametrization,
    memories,
    poses_and_slopes,
)
from fish_sysid.estimation.shooting.schedule import Found, multistep, polished, trusted
from fish_sysid.estimation.shooting.selection import (
    GLANCE,
    WIDEST,
    choose,
    ends,
    extended,
    judged_end,
    largest_command,
    without,
)
from fish_sysid.estimation.shooting.selection import eliminate as eliminate_effects
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
    stepper, windows = shooting.coordinates.stepper, shooting.windows
    pose, slope = poses_and_slopes(stepper, experiment, windows, p, dp, guess.x)
    memory = memories(stepper, experiment, windows, p[None])[0]
    start = np.concatenate([guess.x, memory], axis=1)
    for j in range(len(dp)):
        value, tangent = stepper.rollout_jvp(
            start, windows.commands, p, np.zeros_like(start), np.zeros((1, 1, 2)), dp[j]
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


BAND_FREE = ("head_drag_surge", "head_drag_yaw")
SEEN, UNSEEN = range(8), range(8, 12)


def swum(truth: Robot) -> Experiment:
    random = np.random.default_rng(3)
    kinds = ("steps", "sines", "random", "turn") * 3
    commands = np.stack([program(kind, 10.0, random) for kind in kinds], axis=1)
    made, true = record(truth, commands, Noise(wrench=(1e-3, 2e-3, 5e-5)), random)
    t = DT * np.arange(made.length)
    headings = tuple(Headings(t, true.state[:, m, 2]) for m in range(len(kinds)))
    return replace(made, headings=headings)


def fitted(experiment: Experiment) -> Found:
    hypothesis = nominal_hypothesis(Robot(links=1), BAND_FREE)
    start = Found(hypothesis, np.zeros(len(BAND_FREE) + len(SENSORS)), np.inf)
    return polished(experiment, start, 2.0, 2)


def test_of_one_trial_the_spread_over_folds_is_not_known() -> None:
    experiment = swum(Robot(links=1))
    for trials, known in (([0], False), ([0, 1], True)):
        some = experiment.select(trials)
        hypothesis = nominal_hypothesis(Robot(links=1), BAND_FREE)
        found = Found(hypothesis, np.zeros(len(BAND_FREE) + len(SENSORS)), np.inf)
        _, spread = uncertainty(some, found)
        assert (np.isfinite(spread) == known).all()


def test_bands_hold_errors_of_unseen_trials_of_a_fish_that_the_model_is_not() -> None:
    experiment = swum(Robot(links=1).with_effect("tip_slip", mobility=0.3))
    training, unseen = experiment.select(SEEN), experiment.select(UNSEEN)
    found = fitted(training)
    covariance, _ = uncertainty(training, found)
    good = inside(
        multistep(training, found), multistep(unseen, found), found.z, covariance, horizon=1.0
    )
    assert len(good) >= 20
    assert good.mean() > 0.75


def test_a_trial_with_an_effect_of_its_own_widens_the_band_as_one_left_out() -> None:
    """Its own fit follows it; the fit to the others does not, and that is what a new trial would meet."""
    heavy = Robot(links=1).with_parameters(head_drag_surge=1.0)
    odd = joined([swum(Robot(links=1)).select(range(3)), swum(heavy).select([3])])
    found = fitted(odd)
    cost = multistep(odd, found)
    e, horizon = cost.errors(found.z, cost.states(found.z))[0], cost.targets.horizon
    in_sample = np.quantile(np.abs(e[horizon == 5.0]), 0.95, axis=0) / NORMAL
    speed = 3
    assert missed(cost, found.z)[5.0][speed] > 1.1 * in_sample[speed]


CHOICE_FREE = ("head_drag_surge", "head_drag_yaw")
TRIALS = 8


def swum_for_choice(truth: Robot) -> Experiment:
    random = np.random.default_rng(2)
    kinds = ("steps", "sines", "random", "turn") * (TRIALS // 4)
    commands = np.stack([program(kind, 10.0, random) for kind in kinds], axis=1)
    made, true = record(truth, commands, Noise(wrench=(1e-3, 2e-3, 5e-5)), random)
    t = DT * np.arange(made.length)
    return replace(made, headings=tuple(Headings(t, true.state[:, m, 2]) for m in range(TRIALS)))


def fitted_for_choice(experiment: Experiment) -> Found:
    hypothesis = nominal_hypothesis(Robot(links=1), CHOICE_FREE)
    return polished(
        experiment, Found(hypothesis, np.zeros(len(CHOICE_FREE) + len(SENSORS)), np.inf), 4.0, 2
    )


def test_a_concealed_effect_is_added() -> None:
    experiment = swum_for_choice(Robot(links=1).with_effect("rudder_gain", factor=0.6))
    found, steps = choose(
        experiment, fitted_for_choice(experiment), ("rudder_gain", "rotor_lag"), most=1
    )
    assert found.hypothesis.names == ("rudder_gain",)
    best = next(step for step in steps if step.added)
    assert best.name == "rudder_gain"
    assert best.gain > 2.0 * best.deviation


def test_a_nested_model_that_costs_more_than_its_submodel_starts_again() -> None:
    """From twenty typical drags the fit does not come back; the fit without drag costs less."""
    experiment = swum_for_choice(Robot(links=1))
    found = fitted_for_choice(experiment)
    far, near = (extended(found, "quadratic_drag", strength) for strength in (20.0, GLANCE))
    lost, _ = converged(experiment, [far], found.cost)
    assert lost.cost > 1.5 * found.cost
    fit, costs = converged(experiment, [far, near], found.cost)
    assert fit.cost < 1.01 * found.cost
    assert np.isfinite(costs).all()
    best, _ = converged(experiment, [near, far], 0.0)  # neither ends as low
    assert best.cost == fit.cost


def test_iterations_are_no_evidence_where_nothing_is_concealed() -> None:
    """A fit that has not converged gains by going on; the control gains as much."""
    experiment = swum_for_choice(Robot(links=1).with_parameters(head_drag_surge=0.3))
    hypothesis = nominal_hypothesis(Robot(links=1), CHOICE_FREE)
    unfinished = Found(hypothesis, np.zeros(len(CHOICE_FREE) + len(SENSORS)), np.inf)
    _, steps = choose(experiment, unfinished, ("rotor_lag", "rudder_gain"), most=1)
    assert all(step.gain < 0.1 for step in steps)


def test_an_effect_that_is_there_stays_and_one_that_is_not_earns_nothing() -> None:
    experiment = swum_for_choice(Robot(links=1).with_effect("rudder_gain", factor=0.6))
    hypothesis = nominal_hypothesis(Robot(links=1), CHOICE_FREE)
    for name in ("tail_hardening", "rudder_gain"):
        hypothesis = hypothesis.with_effect(name, 0.3)
    z = np.concatenate([hypothesis.parametrization.origin(), np.zeros(len(SENSORS))])
    start = polished(experiment, Found(hypothesis, z, np.inf), 4.0, 2)
    found, steps = eliminate_effects(experiment, start, ("tail_hardening", "rudder_gain"))
    said = {step.name: step for step in steps}
    assert said["rudder_gain"].added
    assert said["rudder_gain"].gain > 2.0 * said["rudder_gain"].deviation
    assert said["tail_hardening"].gain < 2.0 * said["tail_hardening"].deviation
    assert ("tail_hardening" in found.hypothesis.names) == said["tail_hardening"].added


def test_without_an_effect_all_else_is_as_it_was() -> None:
    hypothesis = nominal_hypothesis(Robot(links=1), CHOICE_FREE).with_effect("rudder_offset", 0.3)
    hypothesis = hypothesis.with_effect("tip_slip", 0.3)
    z = np.arange(1.0, len(hypothesis.free) + len(SENSORS) + 1.0)
    less = without(Found(hypothesis, z, 1.0), "rudder_offset")
    assert less.hypothesis.free == (*CHOICE_FREE, "tip_slip.mobility")
    assert less.z.tolist() == [1.0, 2.0, 4.0, 5.0, 6.0, 7.0, 8.0]


def test_a_step_without_a_fold_is_the_fit_without_it_where_errors_are_linear() -> None:
    random = np.random.default_rng(3)
    J, target, prior = random.standard_normal((40, 4, 3)), random.random(3), np.full(3, 2.0)
    z = random.random(3)
    e = np.einsum("rsp,p->rs", J, z - target) + 0.01 * random.standard_normal((40, 4))
    fold = np.arange(40) % 4
    rows, flat = J.reshape(-1, 3), e.ravel()
    normal = rows.T @ rows + np.diag(1.0 / prior**2)
    steps = fold_steps(e, J, rows.T @ flat + z / prior**2, normal, fold)
    for f, step in enumerate(steps):
        rest = fold != f
        A = np.vstack([J[rest].reshape(-1, 3), np.diag(1.0 / prior)])
        b = np.concatenate([e[rest].ravel(), z / prior])
        right = -np.linalg.lstsq(A, b, rcond=None)[0]
        assert step == pytest.approx(np.clip(right, -LARGEST_STEP, LARGEST_STEP), abs=1e-9)


@pytest.mark.parametrize("true", [1, 2])
def test_another_number_of_links_must_predict_trials_left_out_better(true: int) -> None:
    experiment = swum_for_choice(Robot(links=true))
    found, steps = other_links(
        experiment, fitted_for_choice(experiment), Robot(links=1), CHOICE_FREE, (2,)
    )
    assert found.hypothesis.robot.links == true
    assert [(step.name, step.added) for step in steps] == [("2 links", true == 2)]


def test_the_servo_s_rate_is_held_and_commands_beyond_the_range_leave_it_open() -> None:
    experiment = swum_for_choice(Robot(links=1))
    beyond = replace(experiment, commands=experiment.commands * [1.0, 2.0])
    names = ("head_drag_surge", "servo_rate_limit")
    for trials, end in ((beyond, WIDEST), (experiment, 0.8)):
        hypothesis = prediction_hypothesis(Robot(links=1), trials, names, (), 0.3)
        assert hypothesis.free == ("head_drag_surge",)
        assert hypothesis.robot.parameters["rudder_range"] == end


@pytest.mark.parametrize("end", [0.35, 0.8])
def test_the_rudder_ends_only_where_trials_left_out_show_it(end: float) -> None:
    """The file states 0.3 rad; the true end is below the largest commands, or beyond them."""
    experiment = swum_for_choice(Robot(links=1).with_parameters(rudder_range=end))
    assert largest_command(experiment) == pytest.approx(0.5, abs=0.1)
    stated = Robot(links=1).with_parameters(rudder_range=0.3)
    hypothesis = prediction_hypothesis(stated, experiment, CHOICE_FREE, (), 0.3)
    start = Found(hypothesis, np.zeros(len(CHOICE_FREE) + len(SENSORS)), np.inf)
    found, (step,) = judged_end(experiment, start)
    assert step.added == (end < 0.5)
    values = ShotParametrization(found.hypothesis).robot(found.z[: -len(SENSORS)]).parameters
    assert values["rudder_range"] == pytest.approx(0.35 if end < 0.5 else WIDEST, abs=0.03)


def test_an_end_that_is_tried_is_one_that_a_robot_may_have() -> None:
    """Commands in degrees, or of a servo that turns further, go beyond a quarter of a turn."""
    hypothesis = prediction_hypothesis(
        Robot(links=1), swum_for_choice(Robot(links=1)), CHOICE_FREE, (), 0.3
    )
    start = Found(hypothesis, np.zeros(len(CHOICE_FREE) + len(SENSORS)), np.inf)
    tried = [found.hypothesis.robot.parameters["rudder_range"] for found in ends(start, 2.0)]
    assert tried == sorted(tried)
    assert tried[-1] < WIDEST


def test_an_end_that_starts_too_low_starts_again() -> None:
    """A fit with an end contains the one without: it must not cost much more."""
    experiment = swum_for_choice(Robot(links=1).with_parameters(rudder_range=0.9))
    stated = Robot(links=1).with_parameters(rudder_range=0.3)
    hypothesis = prediction_hypothesis(stated, experiment, CHOICE_FREE, (), 0.3)
    start = Found(hypothesis, np.zeros(len(CHOICE_FREE) + len(SENSORS)), np.inf)
    found, _ = left_out_costs(experiment, start)
    ended, _ = converged(experiment, ends(found, largest_command(experiment)), found.cost)
    assert ended.cost < 1.1 * found.cost


def test_a_fit_to_predictions_finds_the_robot_and_says_how_surely() -> None:
    truth = Robot(links=1).with_parameters(head_drag_surge=0.3, head_drag_yaw=2.2e-3)
    fit = fit_predictions(swum_for_choice(truth), Robot(links=1), CHOICE_FREE, links=(1,))
    errors = np.sqrt(np.diag(fit.covariance))[:2]
    for name, error in zip(CHOICE_FREE, errors, strict=True):
        ratio = fit.robot.parameters[name] / truth.parameters[name]
        assert abs(np.log(ratio)) < 4.0 * error
        assert error < 0.1
    assert fit.sensors["camera_latency.delay"] == pytest.approx(0.0, abs=0.005)
    assert set(fit.parameter_spread) == set(CHOICE_FREE)
    assert fit.found.trust.position > 0.0


def test_start_states_trust_the_sensor_that_is_right() -> None:
    """A camera with ten times its usual noise is trusted less; only the training trials say so."""
    experiment = swum_for_choice(Robot(links=1))
    random = np.random.default_rng(5)
    shaken = tuple(
        Frames(f.t, f.pose + [0.02, 0.02, 0.0] * random.standard_normal(f.pose.shape))
        for f in experiment.frames
    )
    right = Found(
        nominal_hypothesis(Robot(links=1), CHOICE_FREE),
        np.zeros(len(CHOICE_FREE) + len(SENSORS)),
        np.inf,
    )
    clean, noisy = (
        trusted(e, right, 4.0) for e in (experiment, replace(experiment, frames=shaken))
    )
    assert noisy.trust.fading > clean.trust.fading or noisy.trust.position > clean.trust.position
    start, end = (multistep(experiment, f, 4.0).cost(f.z) for f in (right, clean))
    assert end <= start


def test_the_best_of_many_candidates_by_chance_is_seldom_added() -> None:
    random, trials, candidates, repeats = np.random.default_rng(5), 12, 15, 2000
    logarithm = 0.1 * random.standard_normal((repeats, candidates, trials))
    added = [
        any(judged("x", np.exp(row), np.ones(trials), candidates).sure for row in found)
        for found in logarithm
    ]
    assert np.mean(added) == pytest.approx(LEVEL, abs=0.01)


def test_a_fold_of_trials_too_short_for_a_prediction_says_nothing() -> None:
    experiment = swum_for_choice(Robot(links=1)).select([0, 1, 2])
    steps = experiment.steps.copy()
    steps[2] = round(1.5 / DT)
    seen = experiment.frames[2].t < steps[2] * DT
    short = Frames(experiment.frames[2].t[seen], experiment.frames[2].pose[seen])
    mixed = replace(experiment, steps=steps, frames=(*experiment.frames[:2], short))
    _, costs = left_out_costs(mixed, fitted_for_choice(mixed))
    assert np.isfinite(costs).tolist() == [True, True, False]
