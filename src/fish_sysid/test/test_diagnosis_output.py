# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis writes: JSON and the page."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_fits import made_fit

from fish_sim.effects import EFFECTS
from fish_sysid.diagnosis.corrected_model import much_is_left, named, unexplained_share, verdict
from fish_sysid.diagnosis.diagnosis_json import law, mean_interval, unexplained_entry, whiteness
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.diagnosis.next_experiment import next_experiment
from fish_sysid.diagnosis.prediction_evidence import prediction_effects, prediction_entries
from fish_sysid.diagnosis.prediction_rivals import Named
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.shooting.left_out import Step
from fish_sysid.reports.diagnosis_figures import binned_means, moves_water
from fish_sysid.reports.diagnosis_page import (
    EVIDENCE_NOTE,
    NAT,
    _acts_in_a_range,
    _evidence_row,
    _fit_table,
    _found,
    _whiteness,
)
from fish_sysid.reports.verdict_sentence import sentence

NO_LAW = Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4)


def found(names=(), nominal=1.0, final=1.0, left=NO_LAW):
    """A diagnosis with these effects, process noise ratios before and after, and a law of what is left."""
    accepted = tuple(SimpleNamespace(name=name) for name in names)
    before, after = made_fit(0.0, ratio=nominal), made_fit(0.0, ratio=final)
    task = SimpleNamespace(level=Level(), robot=before.robot)
    state = SimpleNamespace(law=left)
    return SimpleNamespace(
        task=task,
        state=state,
        nominal=before,
        final=after,
        accepted=accepted,
        misses=None,
        still_misses=None,
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
    d.surrogate = replace(d.surrogate, theta=np.zeros(len(d.surrogate.theta)))
    assert prediction_entries(d) == []  # the last steps have taken all of its strength
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


def test_nothing_is_said_to_be_missing_only_where_a_name_was_searched_for():
    """Water far rougher than the camera's noise: the model does not follow, and what is left looks like water all the same."""
    d = found(nominal=20.0, final=20.0)
    assert verdict(d) == "no_mismatch"
    assert unexplained_entry(d)["description"] == "the remaining force looks like water noise"
    d.misses = 2.2
    assert verdict(d) == "unexplained"
    said = unexplained_entry(d)["description"]
    assert "misses by 2.2 times the camera's noise, and no name is searched for" in said
    assert said.endswith("; the remaining force looks like water noise")


def test_a_name_or_rival_by_prediction_in_a_limit_does_not_stand():
    d = far(SLIP)
    d.surrogate = made_fit(0.0, "tip_slip")  # no slip at all
    assert prediction_effects(d) == []
    none = replace(GAIN, rivals={"rudder_placement": {"tip_share": 0.0}})
    (gain,) = prediction_effects(far(none))
    assert gain["rivals"] == []
    assert gain["family"] == {"name": "", "members": []}


def effect(name: str, parameters: dict[str, tuple[float, float]], rivals=()) -> dict:
    return {
        "name": name,
        "parameters": {
            k: {"value": v, "std": s, "unit": "m/s"} for k, (v, s) in parameters.items()
        },
        "evidence": {"basis": "likelihood", "probability": 0.84},
        "rivals": [{"name": n, "probability": p} for n, p in rivals],
    }


def content(*effects: dict, links: int = 3, held=("trial_02",)) -> dict:
    return {
        "verdict": "missing_physics",
        "effects": list(effects),
        "fit": {"tail_links": {"given": 3, "used": links}, "held_out_trials": list(held)},
    }


def test_the_sentence_tells_rivals_beside_the_name():
    told = sentence(
        content(effect("tip_slip", {"mobility": (0.1656, 0.00057)}, [("wake_memory", 0.159)]))
    )
    assert told == (
        "missing_physics: the model lacks tip_slip "
        "(mobility 0.1656 ± 0.00057 m/s; probability 0.84; or wake_memory, 0.16)."
    )


def test_of_many_numbers_the_sentence_tells_the_surest():
    gyres = {
        "mean_x": (0.01, 0.01),
        "a": (0.02, 0.001),
        "b": (-0.03, 0.001),
        "c": (0.5, 0.1),
        "d": (0.0, 0.001),
    }
    told = sentence(content(effect("nonuniform_current", gyres), links=4))
    assert (
        "(5 numbers, surest b -0.03 ± 0.001 m/s, a 0.02 ± 0.001 m/s, c 0.5 ± 0.1 m/s; probability"
        in told
    )
    assert told.endswith("The tail is modelled with 4 links instead of 3.")


@pytest.mark.parametrize(
    ("nearest", "told"),
    [
        ([], "unexplained: yaw = (0.001) cos(heading)."),
        (
            ["current"],
            "unexplained: yaw = (0.001) cos(heading). Without explaining most of it, current would help.",
        ),
    ],
)
def test_what_no_name_explains_is_told_with_the_names_that_would_help(nearest, told):
    left = {"description": "yaw = (0.001) cos(heading)", "nearest": nearest}
    assert sentence({**content(), "verdict": "unexplained", "unexplained": left}) == told


def test_what_predictions_ask_for_is_said_beside_the_verdict():
    slip = {
        "name": "tip_slip",
        "parameters": {"mobility": {"value": 0.3, "std": 0.04, "unit": "m/(N s)"}},
        "evidence": {"basis": "prediction", "cost_ratio": 0.4},
    }
    left = {"description": "a strong force", "nearest": [], "by_prediction": [slip]}
    said = sentence({**content(), "verdict": "unexplained", "unexplained": left})
    assert said.startswith(
        "unexplained: a strong force. Predictions of trials left out ask for tip_slip"
    )
    assert "tip_slip (mobility 0.3 ± 0.04 m/(N s); cost x 0.40)" in said


def test_what_predictions_name_is_said_with_what_ties_and_that_more_is_left():
    gain = {
        "name": "rudder_gain",
        "equation": "delta = k * command",
        "parameters": {"gain": {"value": 0.7, "std": 0.02, "unit": ""}},
        "evidence": {
            "basis": "prediction",
            "cost_ratio": 0.8,
            "p_value": 0.004,
            "probability": 0.5,
        },
        "rivals": [{"name": "rudder_placement", "probability": 0.5}],
        "where": {"dof": {}},
    }
    left = {"description": "a strong force", "nearest": [], "by_prediction": []}
    said = sentence({**content(gain), "verdict": "unexplained", "unexplained": left})
    assert said.startswith("unexplained: a strong force. Predictions of trials left out ask for ")
    assert "rudder_gain (gain 0.7 ± 0.02 ; cost x 0.80; or rudder_placement)" in said
    assert "what is left after them has no name." in said
    note = _found(gain).note
    assert "trials left out cost 0.80 times as much" in note
    assert "Could be mistaken for: rudder_placement" in note


def nothing_found(tried, **options) -> str:
    ranking = [{"name": name} for name in tried]
    return sentence({**content(**options), "verdict": "no_mismatch", "ranking": ranking})


def test_that_nothing_is_missing_is_said_only_where_every_name_was_tried():
    told = "no_mismatch: with refitted parameters "
    everything = candidates()
    many = len(everything)
    assert (
        nothing_found(everything)
        == told + "the model explains these recordings; nothing is missing."
    )
    assert nothing_found(everything[:3]) == (
        f"{told}none of the 3 candidates tried (of {many}) is needed; of the others nothing is known."
    )
    assert nothing_found(["current"]) == (
        f"{told}current, the one candidate tried (of {many}), is not needed; of the others nothing is known."
    )


def test_that_no_trial_could_be_held_out_is_said():
    assert nothing_found(["current"], held=()).endswith(
        " With fewer than three trials nothing could be held out: errors are of the trials that were fitted."
    )


@pytest.mark.parametrize(
    ("dof", "told"),
    [
        (
            {"surge": 0.01, "sway": 0.4, "yaw": 0.59},
            "Of the force that was missing without it (variance over that of the water's) acts "
            "1% in surge, 40% in sway, 59% in yaw.",
        ),
        ({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, "No force was missing without it."),
    ],
)
def test_shares_are_of_the_force_that_was_missing(dof, told):
    found = effect("quadratic_drag", {"surge": (0.6, 0.06)})
    assert told in _found({**found, "equation": "X = -c |u| u", "where": {"dof": dof}}).note


@pytest.mark.parametrize(
    ("acts_s", "f1", "shown"),
    [
        (2.0, 0.93, True),  # near a wall
        (5.0, 0.845, False),  # the drag of the example, everywhere: where it is swum fast
        (5.0, 0.96, True),
        (9.0, 0.99, False),  # nearly always
        (2.0, 0.5, False),  # now and then, and no covariate tells when
        (10.0, 1.0, False),  # always
    ],
)
def test_when_an_effect_acts_is_shown_where_a_range_tells_it(acts_s, f1, shown):
    where = {
        "time": [{"trial": "a", "from": 1.0, "to": 1.0 + acts_s, "share": 1.0}],
        "covariates": [{"name": "x", "range": [-0.6, 1.0], "f1": f1}],
    }
    wrench = np.full((1500, 1, 3), np.nan)
    wrench[:1000] = 0.1  # 10 s, what follows is beyond the trial's end
    diagnosis = SimpleNamespace(pushes={"drag": MissingForce(("a",), wrench, wrench, {})})
    assert _acts_in_a_range({"name": "drag", "where": where}, diagnosis) is shown
    assert not _acts_in_a_range(
        {"name": "camera_latency", "where": where}, diagnosis
    )  # does not push


def test_nats_and_p_values_are_explained():
    p = {"before": {"gyro": 0.001}, "after": {"gyro": 0.4}}
    table = _whiteness({"fit": {"residual_whiteness_p": p}})
    assert list(table.header) == ["row", "p before", "p after"]
    assert table.rows == [["gyro", "0.001", "0.4"]]
    assert "Below 0.05 something is left" in table.note
    assert NAT in EVIDENCE_NOTE
    assert "unit of log-likelihood" in NAT


def test_a_quick_fit_that_diverged_says_so():
    found = SimpleNamespace(refitted={})
    rows = [_evidence_row(found, SimpleNamespace(name="tip_slip", gain=g)) for g in (12.4, -np.inf)]
    assert [row[1] for row in rows] == ["12", "diverged"]
    assert "Diverged: " in EVIDENCE_NOTE


def test_bins_of_a_rudder_that_stays_at_its_stop_hold_means_and_no_zeros():
    random = np.random.default_rng(0)
    rudder = np.clip(random.normal(0.0, 1.0, 2000), -0.5, 0.5)
    middle, mean = binned_means(rudder, 3.0 + rudder)
    assert len(middle) < 15
    assert (np.diff(middle) > 0).all()
    # bins at a stop hold the stop itself and what is near it
    np.testing.assert_allclose(mean, 3.0 + middle, atol=0.06)


def test_a_covariate_that_never_changes_or_was_never_measured_has_no_curve():
    for values in (np.zeros(50), np.full(50, np.nan)):
        assert binned_means(values, np.ones(50))[0].size == 0


@pytest.mark.parametrize(
    ("name", "moves"),
    [
        ("current", True),
        ("nonuniform_current", True),
        ("quadratic_drag", False),
        ("camera_latency", False),
    ],
)
def test_a_picture_of_the_water_is_for_effects_that_move_it(name, moves):
    assert moves_water(name) is moves


@pytest.mark.parametrize(
    ("held", "interval", "title", "gain"),
    [
        (
            ["c", "f"],
            [0.1, 0.4],
            "held-out trials",
            "0.250 nats per sample, 95 % interval 0.100 to 0.400.",
        ),
        (["c"], [np.nan, np.nan], "held-out trials", "0.250 nats per sample."),
        ([], [np.nan, np.nan], "too few to hold any out", "0.250 nats per sample."),
    ],
)
def test_errors_are_said_to_be_of_held_out_trials_only_where_some_were(held, interval, title, gain):
    density = {"nominal": 1.0, "refitted": 2.0, "with_effects": 2.25}
    entries = {
        name: {"rms": {}, "log_density_per_sample": value} for name, value in density.items()
    }
    fit = {**entries, "model_yaml": None, "held_out_trials": held, "improvement_ci95": interval}
    found = SimpleNamespace(task=SimpleNamespace(split=SimpleNamespace(held_out=held)))
    table = _fit_table({"fit": fit}, Diagnosis.unseen_are.fget(found))
    assert title in table.title
    assert ("held-out" in table.title) is bool(held)
    assert table.note.endswith(gain)
    assert NAT in table.note
