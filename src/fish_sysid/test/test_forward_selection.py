# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search: which candidates are refitted, look-alikes from the winner's optimum, and what is accepted."""

import numpy as np
import pytest
from made_fits import made_fit
from swims import GIVEN, fish, swim

from fish_sim.robot import Robot
from fish_sysid.diagnosis.cross_validation import gain_unseen, on_all
from fish_sysid.diagnosis.forward_selection import choose, predicts_unseen, significant
from fish_sysid.diagnosis.result import Round, Screened
from fish_sysid.diagnosis.selection_round import (
    refit_look_alike,
    restart_base,
    screen_and_refit,
    shortlist,
    worth_a_refit,
)
from fish_sysid.diagnosis.significance import Level, probabilities
from fish_sysid.diagnosis.task import make_task
from fish_sysid.diagnosis.trial_split import Trials
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import CONTINUE, REFIT, refit
from fish_sysid.estimation.thresholds import SMALLEST_CHECK


@pytest.fixture(scope="module")
def task():
    return make_task(swim(GIVEN, duration=1.0), GIVEN)


def screened(**gains: float) -> list[Screened]:
    return [Screened(name, gain, np.zeros(1)) for name, gain in gains.items()]


def names(found) -> list[str]:
    return [one.name for one in found]


def test_the_best_four_and_look_alikes_of_the_best_are_refitted(task):
    ranking = screened(
        current=900.0, tether=800.0, payload=700.0, sloshing=600.0, nonuniform_current=500.0
    )
    assert names(shortlist(ranking, task, annealed=False)) == names(ranking)
    ranking = screened(current=900.0, tether=100.0)
    assert names(shortlist(ranking, task, annealed=False)) == ["current"]


def test_after_annealing_two_are_refitted_and_of_large_effects_only_the_best(task):
    flow = screened(nonuniform_current=700.0, current=650.0, tether=600.0)
    assert names(shortlist(flow, task, annealed=True)) == ["nonuniform_current", "current"]
    other = screened(current=700.0, nonuniform_current=650.0, tether=600.0)
    assert names(shortlist(other, task, annealed=True)) == ["current", "tether"]
    assert names(shortlist(screened(current=700.0, tether=100.0), task, annealed=True)) == [
        "current"
    ]


def test_what_gains_far_less_than_it_needs_or_no_more_than_chance_is_not_refitted(task):
    """Both gain 29 nats; the flow has seventeen parameters, the sloshing three."""
    flow, wave = screened(nonuniform_current=29.0, sloshing=29.0)
    assert not worth_a_refit(flow, 110.0, task)
    assert worth_a_refit(wave, 30.0, task)


def test_a_round_knows_its_best_and_what_comes_near():
    fits = {"current": made_fit(150.0, "current"), "tether": made_fit(145.0, "tether")}
    found = Round(made_fit(100.0), (), fits)
    assert found.best == "current"
    assert found.gain("tether") == 45.0
    assert found.near_best("tether", 10.0)
    assert not found.near_best("tether", 3.0)
    assert not found.near_best("payload", 10.0)
    assert Round(made_fit(0.0), (), {}).best is None


def test_a_gain_is_significant_only_with_a_strength_that_is():
    strong, weak = np.array([0.0, 1.0]), np.array([0.0, 1e-3])
    sharp = np.diag([1.0, 1e4])
    fits = {
        "rudder_offset": made_fit(150.0, "rudder_offset", theta=strong, information=sharp),
        "rudder_lag": made_fit(150.0, "rudder_lag", theta=weak, information=sharp),
        "gyro_scale": made_fit(105.0, "gyro_scale", theta=strong, information=sharp),
    }
    found = Round(made_fit(100.0), (), fits)
    assert significant(found, 30, Level()) == ["rudder_offset"]
    nothing = Round(made_fit(100.0), (), {"gyro_scale": fits["gyro_scale"]})
    assert choose(nothing, make_task(swim(GIVEN, duration=1.0), GIVEN)) is None


def test_a_look_alike_is_refitted_from_the_optimum_of_the_best():
    """The tip slides; wake_memory with a share of 0 is the same, with two parameters more."""
    data = swim(fish(tip_slip={"mobility": 1.0 / 6.0}), kinds=("sines", "steps"), duration=8.0)
    hypothesis = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    task = make_task(data, GIVEN)
    experiment = task.trials.searched
    base = evaluate(hypothesis, np.log([1.3, 0.8, 1.1]), experiment, Noise())
    wake = hypothesis.with_effect("wake_memory")
    start = np.array([*base.theta, 1.0, 0.0, 0.0])
    best = refit(wake, start, experiment, Noise(), REFIT)
    slip = refit_look_alike(best, base, "tip_slip", 20.0, task)
    assert slip is not None
    assert slip.log_posterior > best.log_posterior - 10.0
    assert slip.values["tip_slip.mobility"] == pytest.approx(1.0 / 6.0, rel=0.1)
    assert refit_look_alike(best, base, "tail_joint_damping", 20.0, task) is None
    assert probabilities({"slip": slip, "wake": best})["slip"] > 0.6


def test_a_base_at_its_best_optimum_stays_when_restarted_from_a_rival():
    data = swim(fish(), kinds=("sines", "steps"), duration=4.0)
    hypothesis = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    good = refit(hypothesis, np.log([1.3, 0.8, 1.1]), data, Noise(), CONTINUE)
    with_scale = hypothesis.with_effect("gyro_scale")
    rival = evaluate(with_scale, np.append(good.theta + 0.1, 0.0), data, good.noise)
    assert restart_base(good, rival, Trials(data, data, data, ())) is good


def test_a_base_far_off_is_screened_by_annealing_and_the_right_name_leads():
    """The rudder is late, and the base makes up for it with wrong parameters and a strong wrench."""
    data = swim(fish(rudder_delay={"delay": 0.09}), duration=6.0)
    free = ("head_added_mass_sway", "link_drag_sway", "tail_stiffness")
    base = evaluate(
        nominal_hypothesis(GIVEN, free), np.array([2.0, 1.5, 1.0]), data, Noise().with_wrench(10.0)
    )
    said: list[str] = []
    task = make_task(data, GIVEN, None, said.append, ("rudder_delay", "current"))
    found = screen_and_refit(base, task.needed(base), task)
    assert found.best == "rudder_delay"
    assert found.refitted["rudder_delay"].values["rudder_delay.delay"] == pytest.approx(
        0.09, abs=0.01
    )
    assert found.refitted["rudder_delay"].largest_ratio < base.largest_ratio / 10.0


@pytest.mark.parametrize("there", [True, False])
def test_a_check_that_does_not_excite_an_effect_passes_the_question_on_to_every_trial(there):
    """The rudder lags; straight trials say nothing of that."""
    robot = Robot().with_effect("rudder_lag", time_constant=0.005) if there else Robot()
    kinds = ("sines", "steps", "random", "straight", "straight")
    training = swim(robot, kinds=kinds, seed=3)
    searched = training.select([0, 1, 2])
    trials = Trials(training, searched, searched, (3, 4))
    nominal = nominal_hypothesis(Robot())
    hypothesis = nominal.with_effect("rudder_lag")
    start = hypothesis.parametrization.origin()
    refitted = refit(nominal, start[: len(nominal.free)], searched, Noise(), REFIT)
    base, fit = on_all(refitted, training), refit(hypothesis, start, searched, Noise(), REFIT)
    gain, expected = gain_unseen(base, on_all(fit, training), trials.check)
    assert max(gain, expected) < SMALLEST_CHECK
    assert predicts_unseen(base, fit, trials, 30, Level()) is there
