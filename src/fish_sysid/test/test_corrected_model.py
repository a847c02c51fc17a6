# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""model.yaml never predicts worse than the refitted nominal model."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.corrected_model import predicts_worse
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

TRUTH = Robot(links=1)


@pytest.fixture(scope="module")
def swum() -> Experiment:
    random = np.random.default_rng(8)
    commands = np.stack([program(kind, 9.0, random) for kind in ("sines", "steps")], axis=1)
    return record(TRUTH, commands, Noise(), random)[0]


def fit_of(robot: Robot, experiment: Experiment) -> Fit:
    return evaluate(nominal_hypothesis(robot, ()), np.zeros(0), experiment, Noise())


def test_the_model_with_the_larger_errors_is_the_worse_one(swum: Experiment) -> None:
    slow = TRUTH.with_parameters(head_drag_surge=3.0 * TRUTH.parameters["head_drag_surge"])
    right, wrong = fit_of(TRUTH, swum), fit_of(slow, swum)
    assert predicts_worse(wrong, right, swum)
    assert not predicts_worse(right, wrong, swum)


def test_what_cannot_be_compared_is_not_worse(swum: Experiment) -> None:
    """No trial is long enough for a prediction over one second."""
    short = shorten(swum, 150)
    first, second = fit_of(TRUTH, short), fit_of(TRUTH, short)
    assert not predicts_worse(first, second, short)
