"""What a grown model is pruned of, and what a richer name gives way to."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_train.diagnose import growth
from fish_train.diagnose.decide import Level
from fish_train.diagnose.diagnosis import Accepted
from fish_train.diagnose.search import Round
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import evaluate
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.synthetic import program, record


def round_of(*names: str) -> Round:
    return Round(None, (), dict.fromkeys(names))


def final_fit(*names: str) -> SimpleNamespace:
    result = SimpleNamespace(samples=np.array([1000.0]))
    return SimpleNamespace(objective=1000.0, result=result, hypothesis=SimpleNamespace(names=names))


@pytest.fixture
def refits(monkeypatch):
    """Objectives of the model without a name, and with another one in its place."""

    def set_to(without: float, instead: float) -> None:
        monkeypatch.setattr(growth, "settle_base", lambda fit, _: fit)
        monkeypatch.setattr(growth, "switched_off", lambda *_: SimpleNamespace(objective=without))
        monkeypatch.setattr(growth, "exchanged", lambda *_: SimpleNamespace(objective=instead))

    return set_to


def pruned(first: str, *rivals: str) -> list[str]:
    accepted = [Accepted(first, round_of(first, *rivals)), Accepted("tip_slip", round_of("tip_slip"))]
    return [
        a.name for a in growth.prune(final_fit(first, "tip_slip"), accepted, None, Level(), lambda _: None)[1]
    ]


@pytest.mark.parametrize(
    ("instead", "name"), [(995.0, "current"), (400.0, "nonuniform_current")], ids=["as good", "far worse"]
)
def test_a_richer_name_gives_way_to_a_simpler_look_alike_that_does_as_well_in_the_end(refits, instead, name):
    """While a sliding tip was missing a flow with seventeen numbers had gained more than one with two."""
    refits(without=100.0, instead=instead)
    assert pruned("nonuniform_current", "current", "wall_effect") == [name, "tip_slip"]


@pytest.mark.parametrize(
    ("first", "rivals"),
    [
        ("current", ["nonuniform_current"]),
        ("nonuniform_current", ["wall_effect"]),
        ("rudder_lag", ["rudder_delay"]),
    ],
    ids=["the rival is richer", "the rival is something else", "the rival is as simple"],
)
def test_nothing_else_gives_way(refits, first, rivals):
    refits(without=100.0, instead=999.0)
    assert pruned(first, *rivals) == [first, "tip_slip"]


def test_what_the_others_have_made_superfluous_is_taken_out(refits):
    refits(without=998.0, instead=0.0)
    assert pruned("nonuniform_current", "current") == ["tip_slip"]


def test_an_exchanged_effect_is_fitted_in_the_place_of_the_other():
    """Sensor errors, which need no kernel of their own: a gyro that reads 5 % too much, taken for the camera's scale."""
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 5.0, random) for kind in ("sines", "steps")], axis=1)
    data = record(Robot(), commands, Noise(), random)[0]
    data = replace(data, gyro=1.05 * data.gyro)
    hypothesis = nominal_hypothesis(Robot(), ("tail_stiffness",)).with_effect("camera_scale", 0.1)
    before = evaluate(hypothesis, np.zeros(len(hypothesis.free)), data, Noise())
    after = growth.exchanged(before, "camera_scale", "gyro_scale", data)
    assert after.hypothesis.names == ("gyro_scale",)
    assert after.objective > before.objective
    scale, std = after.values["gyro_scale.factor"], after.standard_errors["gyro_scale.factor"]
    assert scale == pytest.approx(1.05, abs=4.0 * std) and std < 0.01
