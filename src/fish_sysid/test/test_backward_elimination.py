# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a grown model loses, what competes with each of its effects, and how probable that leaves the names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit
from swims import GIVEN, fish, swim

from fish_sysid.diagnosis.backward_elimination import eliminate, exchanged, rivals
from fish_sysid.diagnosis.diagnosis_json import competition
from fish_sysid.diagnosis.result import Accepted, Round
from fish_sysid.diagnosis.task import make_task
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import REFIT, refit


def accepted(name: str, **log_posteriors: float) -> Accepted:
    contest = {other: made_fit(value, other) for other, value in log_posteriors.items()}
    return Accepted(name, Round(made_fit(0.0), (), contest), contest)


def test_plausible_names_and_simpler_look_alikes_compete_again():
    flow = accepted(
        "nonuniform_current", nonuniform_current=900.0, current=700.0, tether=899.0, payload=100.0
    )
    final = made_fit(1000.0, "nonuniform_current", "tip_slip")
    assert set(rivals(flow, final)) == {"current", "tether"}
    lag = accepted("rudder_lag", rudder_lag=900.0, rudder_delay=100.0)  # no simpler
    assert rivals(lag, made_fit(1000.0, "rudder_lag", "tip_slip")) == []


def test_what_was_added_as_well_is_no_rival():
    first = accepted("current", current=10.0, tip_slip=40.0, tether=9.0)
    second = accepted("tip_slip", current=10.0, tip_slip=40.0, tether=9.0)
    assert list(competition(first, [first, second])) == ["current", "tether"]
    assert list(competition(second, [first, second])) == ["tip_slip", "tether"]
    assert "tip_slip" not in rivals(first, made_fit(1000.0, "current", "tip_slip"))


@pytest.fixture(scope="module")
def offset():
    """Two sensor errors, of which the data have one: a gyro that reads 5 % too much."""
    data = swim(fish(), kinds=("sines", "steps"))
    return replace(data, gyro=1.05 * data.gyro)


def test_an_effect_that_the_others_have_made_superfluous_is_taken_out(offset):
    hypothesis = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    both = hypothesis.with_effect("camera_scale").with_effect("gyro_scale")
    start = np.append(np.log([1.3, 0.8, 1.1]), [0.0, 0.0])
    task = make_task(offset, GIVEN)
    final = refit(both, start, task.trials.training, Noise(), REFIT)
    effects = [
        Accepted(name, Round(final, (), {}), {name: final})
        for name in ("camera_scale", "gyro_scale")
    ]
    smaller, kept = eliminate(final, tuple(effects), task)
    assert [one.name for one in kept] == ["gyro_scale"]
    assert smaller.hypothesis.names == ("gyro_scale",)
    same, both_kept = eliminate(final, tuple(reversed(effects)), task)
    assert [one.name for one in both_kept] == ["gyro_scale", "camera_scale"]
    assert same.log_posterior == pytest.approx(final.log_posterior, abs=1.0)


def test_an_exchanged_effect_is_fitted_in_the_place_of_the_other(offset):
    hypothesis = nominal_hypothesis(GIVEN, ("tail_stiffness",)).with_effect("camera_scale")
    before = evaluate(hypothesis, np.zeros(len(hypothesis.free)), offset, Noise())
    after = exchanged(before, "camera_scale", "gyro_scale", offset)
    assert after.hypothesis.names == ("gyro_scale",)
    assert after.log_posterior > before.log_posterior
    scale, std = after.values["gyro_scale.factor"], after.standard_errors["gyro_scale.factor"]
    assert scale == pytest.approx(1.05, abs=4.0 * std)
    assert std < 0.01
