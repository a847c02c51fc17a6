# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where and when localised effects act, against their own equations."""

from __future__ import annotations

import numpy as np
import pytest

from fish_study.build import make_readings
from fish_study.localisation import (
    dof_overlap,
    overlap,
    stated_range,
    stated_times,
    true_wrench,
)
from fish_study.oracle import (
    as_experiment,
    with_truth,
)
from fish_study.scenario import Scenario
from fish_sysid.diagnosis.effect_wrench import (
    acting,
    effect_wrench,
    f1,
    regimes,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate


def test_overlap_of_times_and_degrees_of_freedom() -> None:
    acts, names = np.zeros((800, 2), dtype=bool), ["trial_00", "trial_01"]
    acts[200:400, 1] = True
    hit = [
        {"trial": "trial_01", "from": 2.0, "to": 4.0},
        {"trial": "elsewhere", "from": 0.0, "to": 8.0},
    ]
    assert overlap(stated_times(hit, names, 800), acts) == 1.0
    assert overlap(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == 0.5
    assert overlap(stated_times([{**hit[0], "trial": "trial_00"}], names, 800), acts) == 0.0
    assert f1(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == pytest.approx(2.0 / 3.0)
    assert dof_overlap({"surge": 0.7, "yaw": 0.3}, {"surge": 0.5, "sway": 0.5}) == 0.5


def test_a_localised_effect_is_seen_where_it_acts() -> None:
    """A fish that swims to a wall, with drag there: the interval before the wall, and the distance as what tells it."""
    effects = {"wall_effect": {"k": 2.5, "length": 0.2}}
    scenario = Scenario("single", 3, effects, count=3, duration=10.0)
    experiment = as_experiment(make_readings(scenario), True)
    push = true_wrench(scenario, experiment)
    assert push is not None
    acts = acting(push, np.array(Noise().wrench))
    near = push.covariates["wall_distance"]
    assert 0.02 < acts.mean() < 0.8
    assert near[acts].mean() < near[~acts].mean()
    assert stated_range(regimes(push, np.array(Noise().wrench)), push.covariates)[acts].mean() > 0.5
    assert true_wrench(Scenario("single", 1, {"current": {"x": 0.03}}), experiment) is None


def test_the_effect_wrench_of_a_drag_is_its_equation() -> None:
    """-k |u| u on the head, from the accelerations with and without it."""
    scenario = Scenario(
        "single",
        1,
        {"quadratic_drag": {"surge": 0.5, "sway": 0.0, "yaw": 0.0}},
        count=2,
        duration=4.0,
    )
    experiment = as_experiment(make_readings(scenario), True)
    hypothesis, theta = with_truth(scenario, scenario.names)
    push = effect_wrench(
        evaluate(hypothesis, theta, experiment, Noise()), "quadratic_drag", experiment
    )
    u = push.covariates["surge_speed"]
    np.testing.assert_allclose(push.wrench[..., 0], -0.5 * np.abs(u) * u, atol=1e-6)
    np.testing.assert_allclose(push.wrench[..., 1:], 0.0, atol=1e-6)


def test_the_effect_wrench_of_a_flow_is_that_of_all_of_it() -> None:
    """The mean of a flow that differs hardly from place to place pushes as the uniform current does."""
    push = {}
    for name, values in (
        ("current", {"x": 0.05}),
        ("nonuniform_current", {"mean_x": 0.05, "shear_x": 1e-4}),
    ):
        scenario = Scenario("single", 1, {name: values}, count=2, duration=2.0)
        experiment = as_experiment(make_readings(scenario), True)
        hypothesis, theta = with_truth(scenario, scenario.names)
        push[name] = effect_wrench(
            evaluate(hypothesis, theta, experiment, Noise()), name, experiment
        ).wrench
    size = np.abs(push["current"]).max()
    np.testing.assert_allclose(push["nonuniform_current"], push["current"], atol=0.05 * size)
