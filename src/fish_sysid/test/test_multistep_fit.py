"""The fit for predictions over seconds: slopes, and a truth that comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.multistep_fit import MultistepError, _huber, fit_multistep
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.identification import is_wrong

FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
NOISE = Noise(wrench=(0.002, 0.004, 1e-4))
TRUTH = Robot().with_parameters(head_drag_surge=0.26, head_drag_yaw=2.4e-3, tail_stiffness=0.08)


@pytest.fixture(scope="module")
def outlook() -> MultistepError:
    random = np.random.default_rng(4)
    commands = np.stack(
        [program(kind, 9.0, random) for kind in ("sines", "random", "steps")], axis=1
    )
    made = MultistepError(
        record(TRUTH, commands, NOISE, random)[0], nominal_hypothesis(Robot(), FREE)
    )
    made.start_from(made.coordinates.origin(), NOISE)
    return made


def test_slopes_equal_differences(outlook: MultistepError) -> None:
    theta = outlook.coordinates.origin() + 0.05
    _, J = outlook.errors(theta)
    for k in range(len(FREE)):
        step = np.zeros(len(FREE))
        step[k] = 1e-4
        numeric = (
            outlook.errors(theta + step, False)[0] - outlook.errors(theta - step, False)[0]
        ) / 2e-4
        np.testing.assert_allclose(J[:, k], numeric, atol=1e-4 * np.abs(numeric).max())


def test_what_a_step_promises_is_about_what_the_fit_brings(outlook: MultistepError) -> None:
    start = outlook.coordinates.origin()
    lowest = outlook.minimise(start)
    least = outlook.cost(lowest)
    for theta in (start, lowest + [-0.2, -0.2, 0.1]):
        fall = outlook.cost(theta) - least
        assert fall > 10.0
        assert outlook.promised(theta) == pytest.approx(least, abs=0.2 * fall)
    assert outlook.promised(lowest) == pytest.approx(least, abs=1.0)


def test_truth_comes_back(outlook: MultistepError) -> None:
    start = evaluate(
        nominal_hypothesis(Robot(), FREE), outlook.coordinates.origin(), outlook.experiment, NOISE
    )
    found = fit_multistep(start, outlook.experiment)
    for name, value in found.values.items():
        assert value == pytest.approx(TRUTH.parameters[name], rel=0.1), name


def test_a_sensor_error_keeps_the_value_and_the_covariance_of_the_fit(
    outlook: MultistepError,
) -> None:
    """Predictions are of the fish: they say nothing of it, and the prior alone would draw it to nothing."""
    turned = tuple(Frames(f.t, f.pose + [0.0, 0.0, 0.3]) for f in outlook.experiment.frames)
    seen = replace(outlook.experiment, frames=turned)
    hypothesis = nominal_hypothesis(Robot(), FREE).with_effect("camera_heading_offset", 0.3)
    theta = hypothesis.parametrization.encode(np.array([*truths(), 0.3]))
    start = evaluate(hypothesis, theta, seen, NOISE)
    found = fit_multistep(start, seen)
    name = "camera_heading_offset.offset"
    assert found.values[name] == pytest.approx(0.3, abs=1e-9)
    assert found.standard_errors[name] == pytest.approx(start.standard_errors[name], rel=0.3)
    assert found.values["head_drag_surge"] == pytest.approx(
        TRUTH.parameters["head_drag_surge"], rel=0.1
    )


def test_what_is_to_be_foretold_is_what_the_sensors_at_theta_saw_not_those_at_the_hypothesis_s_start(
    outlook: MultistepError,
) -> None:
    turned = tuple(Frames(f.t, f.pose + [0.0, 0.0, 0.3]) for f in outlook.experiment.frames)
    hypothesis = nominal_hypothesis(Robot(), FREE).with_effect("camera_heading_offset", 0.3)
    made = MultistepError(replace(outlook.experiment, frames=turned), hypothesis)
    theta = hypothesis.parametrization.encode(np.array([*truths(), 0.3]))
    size = {}
    for offset in (theta[-1], made.coordinates.origin()[-1], theta[-1]):
        made.start_from(np.array([*theta[:-1], offset]), NOISE)
        size[offset] = np.sqrt(np.mean(np.square(made.errors(theta, False)[0])))
    assert size[theta[-1]] < 0.3 * size[made.coordinates.origin()[-1]]


def truths() -> np.ndarray:
    return np.array([TRUTH.parameters[name] for name in FREE])


def test_what_the_data_do_not_determine_is_as_unsure_as_the_prior() -> None:
    """A rudder that never moves says nothing of the servo's rate limit."""
    random = np.random.default_rng(4)
    commands = np.stack([program("straight", 6.0, random) for _ in range(2)], axis=1)
    straight, _ = record(TRUTH, commands, NOISE, random)
    hypothesis = nominal_hypothesis(Robot(), ("head_drag_surge", "servo_rate_limit"))
    made = MultistepError(straight, hypothesis)
    origin = made.coordinates.origin()
    made.start_from(origin, NOISE)
    _, information = made._normal(*made.errors(origin), origin)
    deviation = np.sqrt(np.diag(np.linalg.inv(information)))
    assert deviation[1] == pytest.approx(made.coordinates.prior[1], rel=1e-6)
    assert deviation[0] < 0.5 * made.coordinates.prior[0]


CAMERA_ERRORS = {
    "camera_heading_offset": ({"offset": 0.3}, lambda f: Frames(f.t, f.pose + [0.0, 0.0, 0.3])),
    "camera_scale": ({"factor": 1.2}, lambda f: Frames(f.t, f.pose * [1.2, 1.2, 1.0])),
    "camera_latency": ({"delay": 0.2}, lambda f: Frames(f.t + 0.2, f.pose)),
}


@pytest.mark.parametrize("name", CAMERA_ERRORS)
def test_a_camera_s_error_that_the_model_knows_costs_nothing(
    outlook: MultistepError, name: str
) -> None:
    values, wrong = CAMERA_ERRORS[name]
    seen = replace(outlook.experiment, frames=tuple(map(wrong, outlook.experiment.frames)))

    def size(experiment: Experiment, robot: Robot) -> float:
        judge = MultistepError(experiment, nominal_hypothesis(robot, FREE))
        judge.start_from(np.zeros(len(FREE)), NOISE)
        return float(np.sqrt(np.mean(np.square(judge.errors(np.zeros(len(FREE)), False)[0]))))

    right = size(outlook.experiment, TRUTH)
    assert size(seen, TRUTH.with_effect(name, **values)) == pytest.approx(right, rel=0.15)
    assert size(seen, TRUTH) > 1.5 * right


def test_far_errors_pull_no_harder_than_three() -> None:
    e = np.linspace(-10.0, 10.0, 2001)
    pull = np.gradient(_huber(e), e)
    np.testing.assert_allclose(pull, np.clip(e, -3.0, 3.0), atol=0.011)


def test_nothing_is_foretold_of_what_lies_beyond_a_trial_s_end(outlook: MultistepError) -> None:
    """Images may go on after the last command that is used."""
    short = MultistepError(shorten(outlook.experiment, 500), nominal_hypothesis(Robot(), FREE))
    last = [
        short.starts[t.start, 1] + t.position.max()
        for found in short.targets.values()
        for t in found
    ]
    assert 450 < max(last) <= 498


def test_trials_too_short_to_be_foretold_have_no_errors(outlook: MultistepError) -> None:
    short = MultistepError(shorten(outlook.experiment, 150), nominal_hypothesis(Robot(), FREE))
    short.start_from(np.zeros(len(FREE)), NOISE)
    e, J = short.errors(np.zeros(len(FREE)))
    assert e.shape == (0,)
    assert J.shape == (0, len(FREE))
    assert short.cost(np.zeros(len(FREE))) == 0.0


def test_sensors_far_noisier_than_said_tell_of_a_wrong_model(outlook: MultistepError) -> None:
    fit = evaluate(
        nominal_hypothesis(Robot(), FREE), np.zeros(len(FREE)), outlook.experiment, NOISE
    )
    assert not is_wrong(fit, NOISE)
    assert is_wrong(fit, Noise(gyro=NOISE.gyro / 10.0))


def test_a_force_that_no_water_has_tells_of_a_wrong_model(outlook: MultistepError) -> None:
    fit = evaluate(
        nominal_hypothesis(Robot(), FREE), np.zeros(len(FREE)), outlook.experiment, NOISE
    )
    surge, sway, yaw = Noise().wrench
    rough, impossible = (
        replace(NOISE, wrench=(surge, sway, factor * yaw)) for factor in (5.0, 6.0)
    )
    assert not is_wrong(replace(fit, noise=rough), NOISE)
    assert is_wrong(replace(fit, noise=impossible), NOISE)
