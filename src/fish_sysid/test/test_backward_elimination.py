"""What a grown model is pruned of, what a richer name gives way to, and how probable that leaves the names."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import backward_elimination
from fish_sysid.diagnosis.diagnosis_json import competition
from fish_sysid.diagnosis.forward_selection import Round
from fish_sysid.diagnosis.result import Accepted
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis


def fit_of(objective: float, *names: str) -> SimpleNamespace:
    """As much of a fit as pruning asks for; its evidence is its objective."""
    result = SimpleNamespace(samples=np.array([1000.0]))
    return SimpleNamespace(
        objective=objective, result=result, hypothesis=SimpleNamespace(names=names)
    )


@pytest.fixture
def refits(monkeypatch):
    """Objectives of the model without a name, and with another one in its place; the names that were refitted there."""
    asked = []

    def set_to(without: float, instead: float) -> list[str]:
        def exchanged(fit, name, other, _):
            asked.append(other)
            return fit_of(instead, other, *(n for n in fit.hypothesis.names if n != name))

        monkeypatch.setattr(backward_elimination, "evidence", lambda fit, _: fit.objective)
        monkeypatch.setattr(backward_elimination, "settle_base", lambda fit, _: fit)
        monkeypatch.setattr(backward_elimination, "without", lambda *_: fit_of(without))
        monkeypatch.setattr(backward_elimination, "exchanged", exchanged)
        return asked

    return set_to


def pruned(first: str, **rivals: float) -> list[Accepted]:
    """What becomes of an effect of 900 nats, found before a tip's slip beside rivals with these objectives."""
    contest = {name: fit_of(objective) for name, objective in {first: 900.0, **rivals}.items()}
    slip = {"tip_slip": fit_of(1000.0)}
    accepted = [
        Accepted(first, Round(None, (), contest), contest),
        Accepted("tip_slip", Round(None, (), slip), slip),
    ]
    final = fit_of(1000.0, first, "tip_slip")
    return backward_elimination.prune(final, accepted, None, Level(), lambda _: None)[1]


@pytest.mark.parametrize(
    ("instead", "name"),
    [(995.0, "current"), (400.0, "nonuniform_current")],
    ids=["as good", "far worse"],
)
def test_a_richer_name_gives_way_to_a_simpler_look_alike_that_does_as_well_in_the_end(
    refits, instead, name
):
    """While a sliding tip was missing a flow with seventeen numbers had gained more than one with two."""
    refits(without=100.0, instead=instead)
    first, slip = pruned("nonuniform_current", current=700.0, wall_effect=100.0)
    assert first.name == name
    assert slip.name == "tip_slip"


@pytest.mark.parametrize(
    ("first", "rivals"),
    [
        ("current", {"nonuniform_current": 100.0}),
        ("nonuniform_current", {"wall_effect": 900.0}),
        ("rudder_lag", {"rudder_delay": 900.0}),
    ],
    ids=["the rival is richer", "the rival is something else", "the rival is as simple"],
)
def test_nothing_else_gives_way(refits, first, rivals):
    refits(without=100.0, instead=999.0)
    assert [a.name for a in pruned(first, **rivals)] == [first, "tip_slip"]


def test_a_name_is_as_probable_as_beside_what_was_found_after_it(refits):
    """wake_memory had stood in for a sliding tip that was still missing: no rival of a current once the slip is there."""
    asked = refits(without=100.0, instead=200.0)
    first, slip = pruned("current", wake_memory=1500.0, payload=100.0, wall_effect=895.0)
    assert asked == ["wake_memory"]  # the others had nothing to say in their own round
    assert competition(first, [first, slip]) == pytest.approx(
        {"current": 1.0, "wake_memory": 0.0}, abs=1e-6
    )


def test_what_the_others_have_made_superfluous_is_taken_out(refits):
    refits(without=998.0, instead=0.0)
    assert [a.name for a in pruned("nonuniform_current", current=700.0)] == ["tip_slip"]


def test_an_exchanged_effect_is_fitted_in_the_place_of_the_other():
    """Sensor errors, which need no kernel of their own: a gyro that reads 5 % too much, taken for the camera's scale."""
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 5.0, random) for kind in ("sines", "steps")], axis=1)
    data = record(Robot(), commands, Noise(), random)[0]
    data = replace(data, gyro=1.05 * data.gyro)
    hypothesis = nominal_hypothesis(Robot(), ("tail_stiffness",)).with_effect("camera_scale", 0.1)
    before = evaluate(hypothesis, np.zeros(len(hypothesis.free)), data, Noise())
    after = backward_elimination.exchanged(before, "camera_scale", "gyro_scale", data)
    assert after.hypothesis.names == ("gyro_scale",)
    assert after.objective > before.objective
    scale, std = after.values["gyro_scale.factor"], after.standard_errors["gyro_scale.factor"]
    assert scale == pytest.approx(1.05, abs=4.0 * std)
    assert std < 0.01
