# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the answer says of verdict, evidence, rivals and errors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_fits import made_fit

from fish_sim.effects import EFFECTS
from fish_sysid.diagnosis.corrected_model import much_is_left, named, unexplained_share, verdict
from fish_sysid.diagnosis.diagnosis_json import law, mean_interval, whiteness
from fish_sysid.diagnosis.next_experiment import next_experiment
from fish_sysid.diagnosis.prediction_evidence import prediction_effects, prediction_entries
from fish_sysid.diagnosis.prediction_rivals import Named
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.shooting.left_out import Step

NO_LAW = Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4)


def found(names=(), nominal=1.0, final=1.0, left=NO_LAW):
    """A diagnosis with these effects, process noise ratios before and after, and a law of what is left."""
    accepted = tuple(SimpleNamespace(name=name) for name in names)
    before, after = made_fit(0.0, ratio=nominal), made_fit(0.0, ratio=final)
    task = SimpleNamespace(level=Level(), robot=before.robot)
    state = SimpleNamespace(law=left)
    return SimpleNamespace(
        task=task, state=state, nominal=before, final=after, accepted=accepted, still_misses=None
    )


@pytest.mark.parametrize(
    ("names", "nominal", "final", "expected", "count"),
    [
        (("current", "rudder_lag"), 100.0, 1.0, "missing_physics", 2),
        (("rudder_lag", "gyro_scale"), 100.0, 1.0, "sensor_or_actuator", 2),
        (("current",), 100.0, 40.0, "missing_physics", 1),
        (("current",), 100.0, 60.0, "unexplained", 0),
        ((), 40.0, 40.0, "unexplained", 0),
        ((), 2.0, 2.0, "no_mismatch", 0),
    ],
)
def test_names_stand_unless_they_leave_more_than_they_explain(
    names, nominal, final, expected, count
):
    d = found(names, nominal, final)
    assert verdict(d) == expected
    assert len(named(d)) == count


@pytest.mark.parametrize(
    ("ratio", "gain", "much"), [(2.0, 300.0, True), (5.0, 10.0, False), (40.0, 10.0, True)]
)
def test_much_is_left_where_it_is_far_more_than_water_or_follows_a_law(ratio, gain, much):
    assert much_is_left(found(final=ratio, left=Law({"sway": gain}, {}, 1e4))) is much


def test_the_unexplained_share_is_what_is_left_of_the_density_beyond_usual_water():
    assert unexplained_share(found(nominal=10.0, final=4.0)) == pytest.approx(3.0 / 9.0)
    assert unexplained_share(found()) == 0.0
    assert unexplained_share(found(nominal=2.0, final=2.0)) == 1.0


def test_a_law_that_holds_on_unseen_trials_is_stated_for_every_degree_of_freedom_that_has_one():
    gain = {"surge": 10.0, "sway": 90.0, "yaw": 300.0}
    terms = {
        "surge": {},
        "sway": {"time sway_speed": -0.05},
        "yaw": {"cos(heading)": 1e-3, "rudder": 2e-4},
    }
    left = Law(gain, terms, 1e4)
    assert left.lawful(Level()) == ["yaw", "sway"]
    assert left.lawful(Level(false_alarms=1e-11)) == ["yaw"]  # 4 log(3e11) = 106 nats
    assert Law(gain, terms, 1e6).lawful(Level()) == []  # too little for so many measurements
    text = law(found(left=left), "yaw")
    assert text.startswith("yaw = (0.001) cos(heading) + (0.0002) rudder (SI units; 300 nats")


def test_the_interval_of_a_mean_gain_is_that_of_the_normal_distribution_for_many_trials():
    gain = np.random.default_rng(0).normal(0.3, 0.2, 400)
    middle, half = gain.mean(), 1.96 * gain.std() / 20.0
    assert mean_interval(gain) == pytest.approx([middle - half, middle + half], abs=0.1 * half)
    assert np.isnan(mean_interval(np.array([0.2]))).all()  # one trial has no spread


@pytest.mark.parametrize("trials", [2, 3, 4, 6])
def test_of_few_trials_the_interval_holds_the_mean_gain_in_95_of_100_cases(trials):
    gains = np.random.default_rng(trials).normal(0.3, 1.0, (2000, trials))
    inside = [low <= 0.3 <= high for low, high in map(mean_interval, gains)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)


def test_the_worst_trial_decides_whether_residuals_are_white():
    random = np.random.default_rng(0)
    white = random.standard_normal((600, 3, 7))
    white[1:, 2, 1] += 0.5 * white[:-1, 2, 1]  # the accelerometer of one trial
    white[:, :, 2] = np.nan  # a sensor that is not there
    white[50:, :, 3:6] = np.nan  # too few images
    p = whiteness(SimpleNamespace(result=SimpleNamespace(whitened=white)))
    assert set(p) == {"gyro", "accel_forward"}
    assert p["gyro"] > 0.05
    assert p["accel_forward"] < 1e-10


def test_the_next_experiment_follows_what_is_open():
    assert "nothing was found missing" in next_experiment([], [])["why"]
    turning = next_experiment([], [], grows_with="yaw_rate")
    assert "unexplained" in turning["why"]
    assert {row["rudder"] for row in turning["program"]} == {0.5, -0.5}
    rivals = next_experiment(["rudder_lag"], ["rudder_delay"])
    assert rivals["why"].startswith("tell rudder_lag from rudder_delay")
    apart = next_experiment(["current"], ["quadratic_drag"])  # the rival shows best in coasting
    assert 0.0 in {row["amplitude"] for row in apart["program"]}


def test_a_gyro_that_reads_too_much_shows_in_circles():
    turns = {row["rudder"] for row in next_experiment(["gyro_scale"], [])["program"]}
    assert turns == {0.5, -0.5}


SLIP = Named(Step("tip_slip", np.log(2.5), 0.16, 2.3, 1e-3, added=True), {})
GAIN = Named(
    Step("rudder_gain", np.log(1.25), 0.05, 2.3, 0.01, added=True),
    {"rudder_placement": {"tip_share": 0.4}},
)


def far(*asked, misses: float | None = 3.8, still_misses: float | None = None):
    """A diagnosis of a fish that the model cannot follow, with these effects by prediction, at strengths that are some."""
    effects = [named.step.name for named in asked]
    surrogate = made_fit(0.0, *effects, theta=np.full(len(made_fit(0.0, *effects).theta), 0.5))
    d = found(nominal=100.0, final=100.0)
    d.surrogate, d.predicted, d.misses, d.still_misses = surrogate, asked, misses, still_misses
    return d


def test_where_the_likelihood_was_asked_what_predictions_ask_for_is_no_effect():
    d = far(SLIP, misses=None)
    (entry,) = prediction_entries(d)
    assert entry["name"] == "tip_slip"
    assert entry["kind"] == "physics"
    assert entry["evidence"]["basis"] == "prediction"
    assert entry["evidence"]["cost_ratio"] == pytest.approx(0.4)
    assert entry["parameters"]["mobility"]["unit"] == "m/(N s)"
    assert prediction_effects(d) == []
    nothing = SimpleNamespace(surrogate=None, predicted=(), misses=None)
    assert prediction_entries(nothing) == prediction_effects(nothing) == []


def test_where_it_cannot_be_asked_predictions_name_effects_and_what_ties_with_them():
    d = far(SLIP, GAIN)
    slip, gain = prediction_effects(d)
    assert prediction_entries(d) == []  # each stands in one place
    assert slip["equation"] == EFFECTS["tip_slip"].equation
    assert slip["evidence"]["probability"] == pytest.approx(0.999)
    assert slip["family"] == {"name": "", "members": []}
    assert slip["share"] + gain["share"] == pytest.approx(1.0)
    assert gain["kind"] == "actuator"
    assert gain["evidence"]["probability"] == pytest.approx(0.99 / 2)
    assert [rival["name"] for rival in gain["rivals"]] == ["rudder_placement"]
    assert gain["family"]["name"] == "rudder timing"
    assert gain["family"]["members"][1]["parameters"]["tip_share"]["value"] == 0.4


@pytest.mark.parametrize(
    ("asked", "still_misses", "expected"),
    [
        ((SLIP, GAIN), 1.3, "missing_physics"),
        ((GAIN,), 1.3, "sensor_or_actuator"),
        ((SLIP,), 3.5, "unexplained"),  # the names stand, and much is left without one
        ((), None, "unexplained"),
    ],
)
def test_names_by_prediction_are_the_verdict_where_the_model_follows_with_them(
    asked, still_misses, expected
):
    assert verdict(far(*asked, still_misses=still_misses)) == expected


def test_a_name_or_rival_by_prediction_in_a_limit_does_not_stand():
    d = far(SLIP)
    d.surrogate = made_fit(0.0, "tip_slip")  # no slip at all
    assert prediction_effects(d) == []
    none = replace(GAIN, rivals={"rudder_placement": {"tip_share": 0.0}})
    (gain,) = prediction_effects(far(none))
    assert gain["rivals"] == []
    assert gain["family"] == {"name": "", "members": []}
