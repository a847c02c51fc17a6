# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bands of predictions hold the errors of trials that took no part in the fit, also where the structure is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Headings, joined
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.shooting.prediction_fit import NORMAL, inside, missed, uncertainty
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.schedule import Found, multistep, polished

FREE = ("head_drag_surge", "head_drag_yaw")
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
    hypothesis = nominal_hypothesis(Robot(links=1), FREE)
    start = Found(hypothesis, np.zeros(len(FREE) + len(SENSORS)), np.inf)
    return polished(experiment, start, 2.0, 2)


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
