"""The robot to go on with where no name fits: it predicts better, by effects that help and no others."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import surrogate_model as module
from fish_sysid.diagnosis.surrogate_model import Unpushed, stand_in
from fish_sysid.estimation.effect_selection import left_out_costs
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.multistep_fit import Outlook
from fish_sysid.estimation.parametrization import nominal_hypothesis

FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
WATER = Noise(wrench=(0.002, 0.004, 1e-4))
SLIPPING = Robot().with_parameters(head_drag_surge=0.26).with_effect("tip_slip", mobility=0.3)
KINDS = ("sines", "random", "steps", "turn")


def recorded(robot: Robot, seed: int) -> Experiment:
    random = np.random.default_rng(seed)
    return record(robot, np.stack([program(k, 9.0, random) for k in KINDS], axis=1), WATER, random)[
        0
    ]


@pytest.fixture(scope="module")
def slipping() -> Experiment:
    return recorded(SLIPPING, 4)


def nominal(experiment: Experiment) -> Fit:
    """Of a likelihood that was content with what it got."""
    hypothesis = nominal_hypothesis(Robot(), FREE)
    return evaluate(hypothesis, np.zeros(len(FREE)), experiment, Noise(wrench=(0.1, 0.2, 0.01)))


def mean_error(fit: Fit, experiment: Experiment) -> float:
    outlook = Outlook(experiment, fit.hypothesis)
    outlook.start_from(fit.theta, fit.noise)
    return float(np.abs(outlook.errors(fit.theta, False)[0]).mean())


def test_what_helps_is_taken_and_unseen_trials_are_foretold(slipping: Experiment) -> None:
    """Of three effects, one is true; `current` is neutral here, and a sensor's error predicts no motion."""
    start, said = nominal(slipping), []
    found = stand_in(start, ("current", "camera_scale", "tip_slip"), slipping, said.append)
    assert "tip_slip" in found.hypothesis.names
    assert "camera_scale" not in found.hypothesis.names
    assert found.values["tip_slip.mobility"] == pytest.approx(0.3, rel=0.15)
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)
    unseen = recorded(SLIPPING, 5)
    alone = stand_in(start, (), slipping, said.append)
    assert alone.hypothesis.names == ()
    assert mean_error(found, unseen) < 0.3 * mean_error(alone, unseen)
    assert any("better with tip_slip" in text for text in said)


def test_what_predictions_call_for_most_is_tried_without_being_told(monkeypatch) -> None:
    """A current moves the fish by little in a sample and by much in seconds; nobody named it."""
    monkeypatch.setattr(module, "CALLED", 1)
    drifting = recorded(SLIPPING.with_effect("current", x=0.03, y=-0.02), 7)
    told = ("camera_scale", "rudder_lag", "current")
    found = stand_in(nominal(drifting), ("tip_slip",), drifting, lambda _: None, told)
    assert {"current", "tip_slip"} <= set(found.hypothesis.names)
    assert [found.values[f"current.{axis}"] for axis in "xy"] == pytest.approx(
        [0.03, -0.02], abs=0.004
    )


def test_what_promises_nothing_is_not_called_for(monkeypatch, slipping: Experiment) -> None:
    promised = {
        "rotor_lag": 99.0,
        "current": 101.0,
        "tether": 96.0,
        "wave_drag": 97.5,
        "rudder_lag": 98.0,
    }

    class Promising:
        def __init__(self, experiment, hypothesis, every) -> None:
            self.name = hypothesis.names[-1]

        def start_from(self, theta, noise) -> None:
            assert noise is WATER

        def promised(self, theta) -> float:
            return promised[self.name]

    monkeypatch.setattr(module, "Unpushed", Promising)
    hypothesis = nominal_hypothesis(Robot(), FREE)
    best = module._Tried(hypothesis, np.zeros(len(FREE)), 100.0)
    asked = lambda *names: module._called_for(best, names, WATER, slipping)  # noqa: E731
    # a fall of 4 by four parameters, of 2.5 by three, of 2 and of 1 by one each
    assert asked(*promised) == ["rudder_lag", "rotor_lag"]
    assert asked("tether", "wave_drag") == [
        "tether",
        "wave_drag",
    ]
    assert asked("current") == []
    assert asked() == []


def test_a_model_that_lacks_nothing_gets_nothing_much(slipping: Experiment) -> None:
    """Parameters come back; an effect that is tried is near neutral if it is taken at all."""
    true = Robot().with_parameters(head_drag_surge=0.26, tail_stiffness=0.08)
    experiment = recorded(true, 6)
    found = stand_in(nominal(experiment), ("tip_slip",), experiment, lambda _: None)
    for name in ("head_drag_surge", "tail_stiffness"):
        assert found.values[name] == pytest.approx(true.parameters[name], rel=0.1)
    assert found.values.get("tip_slip.mobility", 0.0) < 0.03


def test_an_effect_with_which_nothing_is_foretold_better_is_not_tried_on_trials_left_out(
    monkeypatch, slipping: Experiment
) -> None:
    """Two costs left out differ by chance: a drag that predicted no better at all was taken so."""
    costs = {(): 100.0, ("tip_slip",): 99.9}

    def fitted(hypothesis, starts, *_):
        return module._Tried(hypothesis, starts[0], costs[tuple(hypothesis.names)])

    monkeypatch.setattr(module, "_fitted", fitted)
    monkeypatch.setattr(module, "_foretells_better", lambda *_: pytest.fail("tried"))
    assert (
        stand_in(nominal(slipping), ("tip_slip",), slipping, lambda _: None).hypothesis.names == ()
    )


def test_a_fit_that_predicts_better_than_what_was_grown_stays(
    slipping: Experiment,
) -> None:
    hypothesis = nominal_hypothesis(SLIPPING, FREE)
    good = evaluate(hypothesis, np.zeros(len(FREE)), slipping, WATER)
    bad = module._Tried(hypothesis, np.full(len(FREE), 1.0), 0.0)
    kept = module._best_of(bad, (nominal(slipping), good), slipping)
    assert (kept.theta == 0.0).all()
    assert kept.hypothesis.names == ("tip_slip",)
    kept = module._best_of(
        module._Tried(hypothesis, np.zeros(len(FREE)), 0.0), (nominal(slipping),), slipping
    )
    assert kept.hypothesis.names == ("tip_slip",)


def test_no_unexplained_force_acts_on_the_predictions(slipping: Experiment) -> None:
    fit = nominal(slipping)
    pushed, free = (kind(slipping, fit.hypothesis) for kind in (Outlook, Unpushed))
    for outlook in (pushed, free):
        outlook.start_from(fit.theta, fit.noise)
    assert np.nanmax(np.abs(pushed.estimates.wrench)) > 0.01
    assert not free.estimates.wrench.any()
    np.testing.assert_array_equal(pushed.estimates.state, free.estimates.state)


def test_trials_too_short_to_predict_leave_the_fit_as_it_is(slipping: Experiment) -> None:
    start = nominal(short := shorten(slipping, 150))
    assert stand_in(start, ("tip_slip",), short, lambda _: None) is start


def test_left_out_trials_are_foretold_by_parameters_that_have_not_seen_them(
    slipping: Experiment,
) -> None:
    fitted, judged = [], []

    class Watched(Unpushed):
        def improve(self, *given, **named):
            fitted.append(set(self.experiment.names))
            return super().improve(
                *given, iterations=1, **{k: v for k, v in named.items() if k != "iterations"}
            )

        def mean_costs(self, theta):
            judged.append((set(self.experiment.names), fitted[-1]))
            return super().mean_costs(theta)

    hypothesis = nominal_hypothesis(Robot(), FREE)
    outlook_on = partial(Watched, hypothesis=hypothesis, every=module.EVERY)
    costs = left_out_costs(outlook_on, np.zeros(len(FREE)), WATER, slipping, module.FOLDS)
    assert np.isfinite(costs).all()
    assert set().union(*(names for names, _ in judged)) == set(slipping.names)
    assert all(not seen & names for names, seen in judged)
