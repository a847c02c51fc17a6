"""The robot to go on with where no name fits: it predicts better, by effects that help and no others."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import surrogate_model as module
from fish_sysid.diagnosis.surrogate_model import WithoutWrench, surrogate_model
from fish_sysid.estimation.effect_selection import left_out_costs
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.multistep_fit import MultistepError
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
    outlook = MultistepError(experiment, fit.hypothesis)
    outlook.start_from(fit.theta, fit.noise)
    return float(np.abs(outlook.errors(fit.theta, False)[0]).mean())


def test_what_helps_is_taken_and_unseen_trials_are_predicted(slipping: Experiment) -> None:
    """Of three effects, one is true; `current` is neutral here, and a sensor's error predicts no motion."""
    start, said = nominal(slipping), []
    found = surrogate_model(start, ("current", "camera_scale", "tip_slip"), slipping, said.append)
    assert "tip_slip" in found.hypothesis.names
    assert "camera_scale" not in found.hypothesis.names
    assert found.values["tip_slip.mobility"] == pytest.approx(0.3, rel=0.15)
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)
    unseen = recorded(SLIPPING, 5)
    alone = surrogate_model(start, (), slipping, said.append)
    assert alone.hypothesis.names == ()
    assert mean_error(found, unseen) < 0.3 * mean_error(alone, unseen)
    assert any("better with tip_slip" in text for text in said)


def test_an_effect_that_predictions_ask_for_is_tried_without_being_named() -> None:
    """A current moves the fish by little in a sample and by much in seconds."""
    drifting = recorded(SLIPPING.with_effect("current", x=0.03, y=-0.02), 7)
    choice = ("camera_scale", "rudder_lag", "current")
    found = surrogate_model(nominal(drifting), ("tip_slip",), drifting, lambda _: None, choice)
    assert {"current", "tip_slip"} <= set(found.hypothesis.names)
    assert [found.values[f"current.{axis}"] for axis in "xy"] == pytest.approx(
        [0.03, -0.02], abs=0.004
    )


def test_a_model_that_lacks_nothing_gets_nothing_much(slipping: Experiment) -> None:
    """Parameters come back; an effect that is tried is near neutral if it is taken at all."""
    true = Robot().with_parameters(head_drag_surge=0.26, tail_stiffness=0.08)
    experiment = recorded(true, 6)
    found = surrogate_model(nominal(experiment), ("tip_slip",), experiment, lambda _: None)
    for name in ("head_drag_surge", "tail_stiffness"):
        assert found.values[name] == pytest.approx(true.parameters[name], rel=0.1)
    assert found.values.get("tip_slip.mobility", 0.0) < 0.03


def test_a_fit_that_predicts_better_than_what_was_grown_stays(
    slipping: Experiment,
) -> None:
    hypothesis = nominal_hypothesis(SLIPPING, FREE)
    good = evaluate(hypothesis, np.zeros(len(FREE)), slipping, WATER)
    bad = module._Fitted(hypothesis, np.full(len(FREE), 1.0), 0.0)
    kept = module._best_of(bad, (nominal(slipping), good), slipping)
    assert (kept.theta == 0.0).all()
    assert kept.hypothesis.names == ("tip_slip",)
    kept = module._best_of(
        module._Fitted(hypothesis, np.zeros(len(FREE)), 0.0), (nominal(slipping),), slipping
    )
    assert kept.hypothesis.names == ("tip_slip",)


def test_no_latent_wrench_acts_on_the_predictions(slipping: Experiment) -> None:
    fit = nominal(slipping)
    pushed, free = (kind(slipping, fit.hypothesis) for kind in (MultistepError, WithoutWrench))
    for outlook in (pushed, free):
        outlook.start_from(fit.theta, fit.noise)
    assert np.nanmax(np.abs(pushed.estimates.wrench)) > 0.01
    assert not free.estimates.wrench.any()
    np.testing.assert_array_equal(pushed.estimates.state, free.estimates.state)


def test_trials_too_short_to_predict_leave_the_fit_as_it_is(slipping: Experiment) -> None:
    start = nominal(short := shorten(slipping, 150))
    assert surrogate_model(start, ("tip_slip",), short, lambda _: None) is start


def test_left_out_trials_are_predicted_by_parameters_that_have_not_seen_them(
    slipping: Experiment,
) -> None:
    fitted, judged = [], []

    class Watched(WithoutWrench):
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
