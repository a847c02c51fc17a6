# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A name takes the place of a law that predicts no better."""

import numpy as np
import pytest
from swims import GIVEN, fish, swim

from fish_sysid.diagnosis.law_or_name import name_for_law
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.result import Round, Screened
from fish_sysid.diagnosis.task import make_task
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import REFIT, refit


@pytest.fixture(scope="module")
def drag():
    """A task, and the round in which the true drag and a rudder's offset were refitted."""
    hidden = {"quadratic_drag": {"surge": 0.3, "sway": 2.0, "yaw": 6e-4}}
    data = swim(fish(**hidden), kinds=("sines", "steps", "random", "turn"), duration=7.0)
    task = make_task(data, GIVEN)
    nominal = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    theta, trials = np.log([1.3, 0.8, 1.1]), task.trials.searched
    base = refit(nominal, theta, trials, Noise(), REFIT)
    fits = {}
    for name in ("quadratic_drag", "rudder_offset"):
        hypothesis = nominal.with_effect(name)
        start = hypothesis.parametrization.origin()
        start[:3] = theta
        fits[name] = refit(hypothesis, start, trials, Noise(), REFIT)
    ranking = tuple(Screened(name, 0.0, fit.theta) for name, fit in fits.items())
    return task, Round(base, ranking, fits)


def law(surge: float) -> Law:
    return Law({"surge": surge, "sway": 0.0, "yaw": 1.0}, {}, 1e3)


def test_the_true_name_stands_for_a_law_that_predicts_no_better(drag):
    task, found = drag
    (accepted,) = name_for_law(found, law(34.0), task)
    assert accepted.name == "quadratic_drag"
    assert accepted.gain_left_out > 34.0
    assert accepted.contest == found.refitted


@pytest.mark.parametrize("surge", [1e6, 2.0], ids=["predicts better", "is none"])
def test_no_name_stands_for_a_law_that(surge, drag):
    task, found = drag
    assert name_for_law(found, law(surge), task) == ()


def test_without_a_refitted_name_the_law_stays(drag):
    task, found = drag
    assert name_for_law(Round(found.base, found.ranking, {}), law(34.0), task) == ()
