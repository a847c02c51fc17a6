"""The fit for predictions over seconds: slopes, and a truth that comes back."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import evaluate
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.identification import is_wrong
from fish_train.identify.outlook import Outlook, fit_outlook
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


def test_sensors_far_noisier_than_said_tell_of_a_wrong_model(outlook: Outlook) -> None:
    fit = evaluate(nominal_hypothesis(Robot(), FREE), np.zeros(len(FREE)), outlook.experiment, NOISE)
    assert not is_wrong(fit, NOISE)
    assert is_wrong(fit, Noise(gyro=NOISE.gyro / 10.0))
