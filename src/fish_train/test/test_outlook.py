"""The fit for predictions over seconds: slopes, and a truth that comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_train.identify.experiment import Experiment, Frames, shorten
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import evaluate
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.identification import is_wrong
from fish_train.identify.outlook import Outlook, _huber, fit_outlook
from fish_train.identify.synthetic import program, record

FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
NOISE = Noise(wrench=(0.002, 0.004, 1e-4))
TRUTH = Robot().with_parameters(head_drag_surge=0.26, head_drag_yaw=2.4e-3, tail_stiffness=0.08)


@pytest.fixture(scope="module")
def outlook() -> Outlook:
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 9.0, random) for kind in ("sines", "random", "steps")], axis=1)
    made = Outlook(record(TRUTH, commands, NOISE, random)[0], nominal_hypothesis(Robot(), FREE))
    made.start_from(made.coordinates.origin(), NOISE)
    return made


def test_slopes_equal_differences(outlook: Outlook) -> None:
    theta = outlook.coordinates.origin() + 0.05
    _, J = outlook.errors(theta)
    for k in range(len(FREE)):
        step = np.zeros(len(FREE))
        step[k] = 1e-4
        numeric = (outlook.errors(theta + step, False)[0] - outlook.errors(theta - step, False)[0]) / 2e-4
        np.testing.assert_allclose(J[:, k], numeric, atol=1e-4 * np.abs(numeric).max())


def test_truth_comes_back(outlook: Outlook) -> None:
    start = evaluate(
        nominal_hypothesis(Robot(), FREE), outlook.coordinates.origin(), outlook.experiment, NOISE
    )
    found = fit_outlook(start, outlook.experiment)
    for name, value in found.values.items():
        assert value == pytest.approx(TRUTH.parameters[name], rel=0.1), name


CAMERA_ERRORS = {
    "camera_heading_offset": ({"offset": 0.3}, lambda f: Frames(f.t, f.pose + [0.0, 0.0, 0.3])),
    "camera_scale": ({"factor": 1.2}, lambda f: Frames(f.t, f.pose * [1.2, 1.2, 1.0])),
    "camera_latency": ({"delay": 0.2}, lambda f: Frames(f.t + 0.2, f.pose)),
}


@pytest.mark.parametrize("name", CAMERA_ERRORS)
def test_a_camera_s_error_that_the_model_knows_costs_nothing(outlook: Outlook, name: str) -> None:
    values, wrong = CAMERA_ERRORS[name]
    seen = replace(outlook.experiment, frames=tuple(map(wrong, outlook.experiment.frames)))

    def size(experiment: Experiment, robot: Robot) -> float:
        judge = Outlook(experiment, nominal_hypothesis(robot, FREE))
        judge.start_from(np.zeros(len(FREE)), NOISE)
        return float(np.sqrt(np.mean(np.square(judge.errors(np.zeros(len(FREE)), False)[0]))))

    right = size(outlook.experiment, TRUTH)
    assert size(seen, TRUTH.with_effect(name, **values)) == pytest.approx(right, rel=0.15)
    assert size(seen, TRUTH) > 1.5 * right


def test_far_errors_pull_no_harder_than_three() -> None:
    e = np.linspace(-10.0, 10.0, 2001)
    pull = np.gradient(_huber(e), e)
    np.testing.assert_allclose(pull, np.clip(e, -3.0, 3.0), atol=0.011)


def test_nothing_is_foretold_of_what_lies_beyond_a_trial_s_end(outlook: Outlook) -> None:
    """Images may go on after the last command that is used."""
    short = Outlook(shorten(outlook.experiment, 500), nominal_hypothesis(Robot(), FREE))
    last = [short.starts[t.start, 1] + t.position.max() for found in short.targets.values() for t in found]
    assert 450 < max(last) <= 498


def test_sensors_far_noisier_than_said_tell_of_a_wrong_model(outlook: Outlook) -> None:
    fit = evaluate(nominal_hypothesis(Robot(), FREE), np.zeros(len(FREE)), outlook.experiment, NOISE)
    assert not is_wrong(fit, NOISE)
    assert is_wrong(fit, Noise(gyro=NOISE.gyro / 10.0))


def test_a_force_that_no_water_has_tells_of_a_wrong_model(outlook: Outlook) -> None:
    fit = evaluate(nominal_hypothesis(Robot(), FREE), np.zeros(len(FREE)), outlook.experiment, NOISE)
    surge, sway, yaw = Noise().wrench
    rough, impossible = (replace(NOISE, wrench=(surge, sway, factor * yaw)) for factor in (5.0, 6.0))
    assert not is_wrong(replace(fit, noise=rough), NOISE)
    assert is_wrong(replace(fit, noise=impossible), NOISE)
