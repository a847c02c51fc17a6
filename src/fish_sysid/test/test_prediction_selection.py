# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects are chosen by trials left out against a control with as many iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames, Headings
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.shooting.left_out import (
    LEVEL,
    converged,
    fold_steps,
    judged,
    left_out_costs,
)
from fish_sysid.estimation.shooting.multistep import LARGEST_STEP
from fish_sysid.estimation.shooting.prediction_fit import (
    fit_predictions,
    other_links,
    prediction_hypothesis,
)
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.rollout import ShotParametrization
from fish_sysid.estimation.shooting.schedule import Found, multistep, polished, trusted
from fish_sysid.estimation.shooting.selection import (
    GLANCE,
    WIDEST,
    choose,
    eliminate,
    ends,
    extended,
    judged_end,
    largest_command,
    without,
)

FREE = ("head_drag_surge", "head_drag_yaw")
TRIALS = 8


def swum(truth: Robot) -> Experiment:
    random = np.random.default_rng(2)
    kinds = ("steps", "sines", "random", "turn") * (TRIALS // 4)
    commands = np.stack([program(kind, 10.0, random) for kind in kinds], axis=1)
    made, true = record(truth, commands, Noise(wrench=(1e-3, 2e-3, 5e-5)), random)
    t = DT * np.arange(made.length)
    return replace(made, headings=tuple(Headings(t, true.state[:, m, 2]) for m in range(TRIALS)))


def fitted(experiment: Experiment) -> Found:
    hypothesis = nominal_hypothesis(Robot(links=1), FREE)
    return polished(
        experiment, Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf), 4.0, 2
    )


def test_a_concealed_effect_is_added() -> None:
    experiment = swum(Robot(links=1).with_effect("rudder_gain", factor=0.6))
    found, steps = choose(experiment, fitted(experiment), ("rudder_gain", "rotor_lag"), most=1)
    assert found.hypothesis.names == ("rudder_gain",)
    best = next(step for step in steps if step.added)
    assert best.name == "rudder_gain"
    assert best.gain > 2.0 * best.deviation


def test_a_nested_model_that_costs_more_than_its_submodel_starts_again() -> None:
    """From twenty typical drags the fit does not come back; the fit without drag costs less."""
    experiment = swum(Robot(links=1))
    found = fitted(experiment)
    far, near = (extended(found, "quadratic_drag", strength) for strength in (20.0, GLANCE))
    lost, _ = converged(experiment, [far], found.cost)
    assert lost.cost > 1.5 * found.cost
    fit, costs = converged(experiment, [far, near], found.cost)
    assert fit.cost < 1.01 * found.cost
    assert np.isfinite(costs).all()


def test_iterations_are_no_evidence_where_nothing_is_concealed() -> None:
    """A fit that has not converged gains by going on; the control gains as much."""
    experiment = swum(Robot(links=1).with_parameters(head_drag_surge=0.3))
    hypothesis = nominal_hypothesis(Robot(links=1), FREE)
    unfinished = Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf)
    _, steps = choose(experiment, unfinished, ("rotor_lag", "rudder_gain"), most=1)
    assert all(step.gain < 0.1 for step in steps)


def test_an_effect_that_is_there_stays_and_one_that_is_not_earns_nothing() -> None:
    experiment = swum(Robot(links=1).with_effect("rudder_gain", factor=0.6))
    hypothesis = nominal_hypothesis(Robot(links=1), FREE)
    for name in ("tail_hardening", "rudder_gain"):
        hypothesis = hypothesis.with_effect(name, 0.3)
    z = np.concatenate([hypothesis.parametrization.origin(), np.zeros(len(SENSORS))])
    start = polished(experiment, Found(hypothesis, z, np.inf), 4.0, 2)
    found, steps = eliminate(experiment, start, ("tail_hardening", "rudder_gain"))
    said = {step.name: step for step in steps}
    assert said["rudder_gain"].added
    assert said["rudder_gain"].gain > 2.0 * said["rudder_gain"].deviation
    assert said["tail_hardening"].gain < 2.0 * said["tail_hardening"].deviation
    assert ("tail_hardening" in found.hypothesis.names) == said["tail_hardening"].added


def test_without_an_effect_all_else_is_as_it_was() -> None:
    hypothesis = nominal_hypothesis(Robot(links=1), FREE).with_effect("rudder_offset", 0.3)
    hypothesis = hypothesis.with_effect("tip_slip", 0.3)
    z = np.arange(1.0, len(hypothesis.free) + len(SENSORS) + 1.0)
    less = without(Found(hypothesis, z, 1.0), "rudder_offset")
    assert less.hypothesis.free == (*FREE, "tip_slip.mobility")
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
    experiment = swum(Robot(links=true))
    found, steps = other_links(experiment, fitted(experiment), Robot(links=1), FREE, (2,))
    assert found.hypothesis.robot.links == true
    assert [(step.name, step.added) for step in steps] == [("2 links", true == 2)]


def test_the_servo_s_rate_is_held_and_commands_beyond_the_range_leave_it_open() -> None:
    experiment = swum(Robot(links=1))
    beyond = replace(experiment, commands=experiment.commands * [1.0, 2.0])
    names = ("head_drag_surge", "servo_rate_limit")
    for trials, end in ((beyond, WIDEST), (experiment, 0.8)):
        hypothesis = prediction_hypothesis(Robot(links=1), trials, names, (), 0.3)
        assert hypothesis.free == ("head_drag_surge",)
        assert hypothesis.robot.parameters["rudder_range"] == end


@pytest.mark.parametrize("end", [0.35, 0.8])
def test_the_rudder_ends_only_where_trials_left_out_show_it(end: float) -> None:
    """The file states 0.3 rad; the true end is below the largest commands, or beyond them."""
    experiment = swum(Robot(links=1).with_parameters(rudder_range=end))
    assert largest_command(experiment) == pytest.approx(0.5, abs=0.1)
    stated = Robot(links=1).with_parameters(rudder_range=0.3)
    hypothesis = prediction_hypothesis(stated, experiment, FREE, (), 0.3)
    start = Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf)
    found, (step,) = judged_end(experiment, start)
    assert step.added == (end < 0.5)
    values = ShotParametrization(found.hypothesis).robot(found.z[: -len(SENSORS)]).parameters
    assert values["rudder_range"] == pytest.approx(0.35 if end < 0.5 else WIDEST, abs=0.03)


def test_an_end_that_is_tried_is_one_that_a_robot_may_have() -> None:
    """Commands in degrees, or of a servo that turns further, go beyond a quarter of a turn."""
    hypothesis = prediction_hypothesis(Robot(links=1), swum(Robot(links=1)), FREE, (), 0.3)
    start = Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf)
    tried = [found.hypothesis.robot.parameters["rudder_range"] for found in ends(start, 2.0)]
    assert tried == sorted(tried)
    assert tried[-1] < WIDEST


def test_an_end_that_starts_too_low_starts_again() -> None:
    """A fit with an end contains the one without: it must not cost much more."""
    experiment = swum(Robot(links=1).with_parameters(rudder_range=0.9))
    stated = Robot(links=1).with_parameters(rudder_range=0.3)
    hypothesis = prediction_hypothesis(stated, experiment, FREE, (), 0.3)
    start = Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf)
    found, _ = left_out_costs(experiment, start)
    ended, _ = converged(experiment, ends(found, largest_command(experiment)), found.cost)
    assert ended.cost < 1.1 * found.cost


def test_a_fit_to_predictions_finds_the_robot_and_says_how_surely() -> None:
    truth = Robot(links=1).with_parameters(head_drag_surge=0.3, head_drag_yaw=2.2e-3)
    fit = fit_predictions(swum(truth), Robot(links=1), FREE, links=(1,))
    errors = np.sqrt(np.diag(fit.covariance))[:2]
    for name, error in zip(FREE, errors, strict=True):
        ratio = fit.robot.parameters[name] / truth.parameters[name]
        assert abs(np.log(ratio)) < 4.0 * error
        assert error < 0.1
    assert fit.sensors["camera_latency.delay"] == pytest.approx(0.0, abs=0.005)
    assert set(fit.parameter_spread) == set(FREE)
    assert fit.found.trust.position > 0.0


def test_start_states_trust_the_sensor_that_is_right() -> None:
    """A camera with ten times its usual noise is trusted less; only the training trials say so."""
    experiment = swum(Robot(links=1))
    random = np.random.default_rng(5)
    shaken = tuple(
        Frames(f.t, f.pose + [0.02, 0.02, 0.0] * random.standard_normal(f.pose.shape))
        for f in experiment.frames
    )
    right = Found(
        nominal_hypothesis(Robot(links=1), FREE), np.zeros(len(FREE) + len(SENSORS)), np.inf
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
    experiment = swum(Robot(links=1)).select([0, 1, 2])
    steps = experiment.steps.copy()
    steps[2] = round(1.5 / DT)
    seen = experiment.frames[2].t < steps[2] * DT
    short = Frames(experiment.frames[2].t[seen], experiment.frames[2].pose[seen])
    mixed = replace(experiment, steps=steps, frames=(*experiment.frames[:2], short))
    _, costs = left_out_costs(mixed, fitted(mixed))
    assert np.isfinite(costs).tolist() == [True, True, False]
