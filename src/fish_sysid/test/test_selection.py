# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search for effects: vocabulary, split of trials, screening, tests, selection, elimination, number of links."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_fits import made_fit
from scipy.stats import multivariate_normal, norm
from swims import GIVEN, fish, swim

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import screening
from fish_sysid.diagnosis.backward_elimination import eliminate, exchanged, rivals, without
from fish_sysid.diagnosis.cross_validation import gain_left_out, gain_unseen, on_all, predicted
from fish_sysid.diagnosis.diagnosis_json import competition
from fish_sysid.diagnosis.forward_selection import Selection, choose, predicts_unseen, significant
from fish_sysid.diagnosis.model_order import better_order, fit_links, promises_more
from fish_sysid.diagnosis.pipeline import fit_nominal
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.result import Accepted, Round, Screened
from fish_sysid.diagnosis.selection_round import (
    restart_base,
    screen_and_refit,
    shortlist,
    worth_a_refit,
)
from fish_sysid.diagnosis.significance import (
    Level,
    evidence,
    p_value,
    probabilities,
    simplest,
    strength_z,
)
from fish_sysid.diagnosis.task import Trials, excitation, make_task, split_trials, trials_of
from fish_sysid.diagnosis.vocabulary import (
    candidates,
    identifiable,
    kind_of,
    known,
    known_effects,
    not_excited,
    start_hypothesis,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import climb, evaluate
from fish_sysid.estimation.parametrization import NOMINAL_FREE, nominal_hypothesis
from fish_sysid.estimation.refit import CONTINUE, REFIT, alternate, refit
from fish_sysid.estimation.shooting.prediction_fit import with_links
from fish_sysid.estimation.thresholds import (
    NEAR_GAIN,
    OPEN_GATE,
    POLISH_ITERATIONS,
    SMALLEST_CHECK,
    TEMPER,
)


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


def test_a_round_knows_its_best():
    fits = {"current": made_fit(150.0, "current"), "tether": made_fit(145.0, "tether")}
    found = Round(made_fit(100.0), (), fits)
    assert found.best == "current"
    assert found.gain("tether") == 45.0
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


def test_a_base_at_its_best_optimum_stays_when_restarted_from_a_rival():
    data = swim(fish(), kinds=("sines", "steps"), duration=4.0)
    hypothesis = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    good = refit(hypothesis, np.log([1.3, 0.8, 1.1]), data, Noise(), CONTINUE)
    with_scale = hypothesis.with_effect("gyro_scale")
    rival = evaluate(with_scale, np.append(good.theta + 0.1, 0.0), data, good.noise)
    assert restart_base(good, rival, Trials(data, data, data, ())) is good


def test_a_base_far_off_takes_the_optimum_that_a_rival_leads_to():
    """Also where a refit of short trials leads the base to that optimum as well."""
    data = swim(fish(), kinds=("sines", "steps"), duration=4.0)
    hypothesis = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway", "tail_stiffness"))
    good = refit(hypothesis, np.log([1.3, 0.8, 1.1]), data, Noise(), REFIT)
    poor = evaluate(hypothesis, good.theta + 0.5, data, good.noise)
    with_scale = hypothesis.with_effect("gyro_scale")
    rival = evaluate(with_scale, np.append(good.theta + 0.05, 0.0), data, good.noise)
    restarted = restart_base(poor, rival, Trials(data, data, data, ()))
    assert restarted.log_posterior > good.log_posterior - 3.0
    np.testing.assert_allclose(restarted.theta, good.theta, atol=0.02)


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


def test_a_fit_less_an_effect_keeps_its_other_parameters_and_takes_the_noise_it_needs(offset):
    hypothesis = nominal_hypothesis(GIVEN, ("tail_stiffness",)).with_effect("gyro_scale")
    both = refit(hypothesis, np.array([np.log(1.1), 0.0]), offset, Noise(), REFIT)
    less = without(both, "gyro_scale", offset)
    assert less.hypothesis.names == ()
    np.testing.assert_array_equal(less.theta, both.theta[:1])
    assert less.log_posterior < both.log_posterior - 10.0
    assert less.noise.wrench[2] > 2.0 * both.noise.wrench[2]  # in yaw


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


@pytest.mark.parametrize(
    ("robot", "name", "key", "hidden", "near", "place"),
    [
        (
            GIVEN,
            "sloshing",
            "frequency",
            {"sine": -0.02, "cosine": 0.01, "frequency": 0.77},
            0.8,
            screening.place_near,
        ),
        (
            GIVEN,
            "wave_drag",
            "speed",
            {"amplitude": 0.03, "speed": 0.13, "width": 0.03},
            0.12,
            screening.place_far,
        ),
        (Robot(), "rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.place_near),
        (Robot(), "rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.place_far),
    ],
)
def test_an_effect_is_found_from_the_place_that_promises_most(
    robot, name, key, hidden, near, place
):
    """From a single start value, no step leads there."""
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 7.0, random) for kind in ("sines", "straight")], axis=1)
    experiment = record(robot.with_effect(name, **hidden), commands, Noise(), random)[0]
    drags = nominal_hypothesis(robot, ("head_drag_surge", "head_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    assert screening.best_place(base, name, experiment, base.noise)[key] == pytest.approx(near)
    fit = alternate(place(base, name, experiment), experiment)
    assert fit.values[f"{name}.{key}"] == pytest.approx(hidden[key], rel=0.1)


@pytest.mark.parametrize("below", [0.95, 0.5, 0.25])
def test_a_rotor_that_is_limited_is_found_without_its_encoder(below):
    """No step leads down from a limit that no command reaches, though it is nearer to the truth than the others."""
    random = np.random.default_rng(1)
    commands = np.stack(
        [program(kind, 6.0, random) for kind in ("steps", "sines", "random")], axis=1
    )
    limit = below * np.abs(commands[..., 0]).max()
    seen = record(GIVEN.with_effect("rotor_saturation", limit=limit), commands, Noise(), random)[0]
    experiment = replace(seen, encoder=np.full_like(seen.encoder, np.nan))
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    fit = alternate(screening.place_far(base, "rotor_saturation", experiment), experiment)
    assert fit.values["rotor_saturation.limit"] == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("place_candidate", [screening.place_near, screening.place_far])
def test_a_hump_of_drag_is_not_lost_while_it_is_weak(place_candidate):
    """A step of its speed and width, which seem free while it is weak, leads a weak hump to where the fish never swims."""
    random = np.random.default_rng(9)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "straight", "random")], axis=1
    )
    place = {"speed": 0.145, "width": 0.035}
    hump = Robot().with_effect("wave_drag", amplitude=0.02, **place)
    experiment = record(hump, commands, Noise(), random)[0]
    nominal = nominal_hypothesis(Robot())
    base = alternate(
        evaluate(nominal, np.zeros(len(nominal.free)), experiment, Noise()), experiment
    )
    fit = climb(place_candidate(base, "wave_drag", experiment), experiment, POLISH_ITERATIONS)
    truth = screening.started(base, "wave_drag", 1.0, place)
    best = climb(evaluate(fit.hypothesis, truth, experiment, base.noise), experiment, 20)
    assert fit.log_posterior > best.log_posterior - 3.0 > base.log_posterior + 15.0


def test_images_half_a_second_old_are_found():
    """A stroke is half a second: the heading fits again without a delay."""
    random = np.random.default_rng(6)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    experiment = record(GIVEN, commands, Noise(), random)[0]
    late = replace(experiment, frames=tuple(replace(f, t=f.t + 0.47) for f in experiment.frames))
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_yaw", "fin_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(3), late, Noise()), late)
    fit = alternate(screening.place_far(base, "camera_latency", late), late)
    assert fit.values["camera_latency.delay"] == pytest.approx(0.47, abs=0.005)


def test_an_effect_far_weaker_than_typical_is_found_where_little_is_left():
    """From a typical strength, which the data refuse by tens of thousands of nats, no step leads back to a weak one."""
    random = np.random.default_rng(8)
    commands = np.stack(
        [program(kind, 12.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    weak = GIVEN.with_effect("tail_hardening", k3=0.036)
    experiment = record(weak, commands, Noise(), random)[0]
    free = nominal_hypothesis(GIVEN, ("tail_stiffness", "fin_drag_sway"))
    base = alternate(evaluate(free, np.zeros(2), experiment, Noise()), experiment)
    fit = screening.place_near(base, "tail_hardening", experiment)
    assert screening.promise(fit) > base.log_posterior + 100.0
    assert alternate(fit, experiment).values["tail_hardening.k3"] == pytest.approx(0.036, rel=0.05)


def test_a_large_effect_of_the_base_is_held_while_screening_and_free_at_the_end():
    """For speed; what it absorbs of a candidate is not in the candidate's gain."""
    random = np.random.default_rng(5)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    truth = GIVEN.with_effect("nonuniform_current", gyre_11=0.03, shear_x=0.02)
    truth = truth.with_effect("rudder_offset", offset=0.08)
    experiment = record(truth, commands, Noise(), random)[0]
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_yaw"))
    flow = drags.with_effect("nonuniform_current")
    base = alternate(evaluate(flow, np.zeros(len(flow.free)), experiment, Noise()), experiment)
    held = screening.hold_large(base, experiment)
    assert held.hypothesis.free == drags.free
    assert held.log_posterior == pytest.approx(base.log_posterior, abs=100.0)
    assert held.robot == base.robot
    task = make_task(experiment, GIVEN)
    first = screening.screen(base, ["rudder_offset"], task)[0]
    assert first.gain > 50.0
    assert len(first.theta) == len(base.theta) + 1
    offset = base.hypothesis.with_effect("rudder_offset").parametrization.decode(first.theta)[-1]
    assert offset == pytest.approx(0.08, abs=0.02)


def test_a_rudder_offset_is_found_in_straight_swims():
    """Nothing is steered, and the fish circles."""
    data = swim(fish(3, rudder_offset={"offset": 0.08}), kinds=("straight",), duration=3.0)
    names = ("rudder_offset", "camera_scale")
    task = make_task(data, Robot(), names=names)
    gains = {one.name: one.gain for one in screening.screen(fit_nominal(task), names, task)}
    assert gains["rudder_offset"] > gains["camera_scale"] + 100.0


def test_the_level_is_checked_and_falls_with_the_false_alarms():
    with pytest.raises(ValueError, match=r"false_alarms: got 0.9"):
        Level(0.9)
    assert Level(0.001).needed(100, 1, 30) > Level(0.1).needed(100, 1, 30)
    exponential = 4.0 * np.log(30 / 0.02)  # chi square of two
    assert Level(0.02).needed(0, 2, 30) == pytest.approx(exponential)
    assert Level().needed(1e6, 1, 30) == 1000.0  # a thousandth of a nat per measurement


def test_a_law_that_is_not_true_reaches_what_is_needed_as_seldom_as_the_level_says():
    """Markov's bound on the tempered likelihood ratio, times the tests; and half of a name's gain at least."""
    assert 30 * np.exp(-Level(0.01).needed_unseen(0.0, 30) / TEMPER) == pytest.approx(0.01)
    assert Level(0.01).needed_unseen(1e9, 30) == pytest.approx(0.5 * Level(0.01).needed(1e9, 1, 30))


def test_p_values_are_of_the_tempered_ratio_times_the_names_tried():
    assert p_value(5.0 * TEMPER, 2, 3) == pytest.approx(3.0 * np.exp(-5.0))
    assert p_value(-1.0, 1, 1) == 1.0
    assert p_value(0.1, 2, 30) == 1.0


def test_probabilities_add_up_the_most_probable_first():
    fits = {
        "a": made_fit(-110.0, "current"),
        "b": made_fit(-100.0, "current"),
        "c": made_fit(-500.0, "current"),
    }
    found = probabilities(fits)
    assert list(found) == ["b", "a", "c"]
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["b"] / found["a"] == pytest.approx(np.exp(10.0 / TEMPER))
    assert probabilities({}) == {}


def test_a_parameter_that_nothing_asks_for_costs_evidence():
    sharp = np.diag([100.0, 100.0, 100.0])
    one = made_fit(-100.0, "rudder_offset", information=sharp[:2, :2])
    two = made_fit(-100.0, "current", information=sharp)
    assert evidence(one) > evidence(two) + 1.0


@pytest.mark.parametrize(
    ("best", "other", "behind", "chosen"),
    [
        ("nonuniform_current", "current", 5.0, "current"),
        ("nonuniform_current", "current", 500.0, "nonuniform_current"),
        ("nonuniform_current", "wall_effect", 5.0, "nonuniform_current"),  # something else
        ("rudder_lag", "rudder_delay", 1.0, "rudder_lag"),  # as simple
        ("current", "nonuniform_current", 1.0, "current"),  # richer
    ],
)
def test_a_simpler_look_alike_that_does_as_well_stands_for_a_richer_name(
    best, other, behind, chosen
):
    fits = {best: made_fit(900.0, best), other: made_fit(900.0 - behind, other)}
    assert simplest(best, fits, Level()) == chosen


def test_a_strength_is_as_sure_as_at_its_own_place():
    """A payload's mass times place may be known alone: its place does not blur it, another parameter does."""
    information = np.diag([4.0, 100.0, 1.0, 1.0])
    information[1, 2] = information[2, 1] = 9.999
    theta = np.array([9.0, -0.5, 3.0, 0.0])
    known = made_fit(0.0, "payload", theta=theta, information=information)
    assert known.hypothesis.free[1] == "payload.mass"
    assert strength_z(known, "payload") == pytest.approx(0.5 * 10.0)
    blurred = information.copy()
    blurred[0, 1] = blurred[1, 0] = 16.0  # correlated by 0.8 with the drag
    known = made_fit(0.0, "payload", theta=theta, information=blurred)
    assert strength_z(known, "payload") == pytest.approx(0.5 * 10.0 * 0.6)


def test_strengths_that_are_unsure_alone_may_be_sure_together():
    """Two strengths of which the data determine the sum alone; p is that of chi square with two degrees."""
    own = np.array([[100.0, 99.0], [99.0, 100.0]])
    information, theta = np.eye(3), np.array([0.0, 0.4, 0.4])
    information[1:, 1:] = own
    assert (theta[1:] / np.sqrt(np.diag(np.linalg.inv(own)))).max() < 1.0
    fit = made_fit(0.0, "current", theta=theta, information=information)
    wald = theta[1:] @ own @ theta[1:]  # exponential under the null: p = exp(-wald / 2)
    assert 2.0 * norm.sf(strength_z(fit, "current")) == pytest.approx(np.exp(-0.5 * wald))
    assert strength_z(fit, "current") > 7.0


PRIOR = np.array([0.5, 4.0])
LINEAR = SimpleNamespace(parametrization=SimpleNamespace(prior=PRIOR))


def regression(x, y, used=(0, 1)):
    """The fit of y = x theta + unit noise at its optimum; a parameter that is not used stays 0. x: (trials, samples, 2)."""
    x = x * np.isin((0, 1), used)
    theta = np.linalg.solve(
        np.einsum("tsi,tsj->ij", x, x) + np.diag(PRIOR**-2), np.einsum("tsi,ts->i", x, y)
    )
    left = y - x @ theta
    result = SimpleNamespace(
        gradient=-np.einsum("ts,tsi->ti", left, x),
        normal=np.einsum("tsi,tsj->tij", x, x),
        whitened=left.T[..., None],
    )
    likelihood = -0.5 * np.sum(left**2 + np.log(2 * np.pi), axis=1)
    return SimpleNamespace(hypothesis=LINEAR, theta=theta, log_likelihood=likelihood, result=result)


def exact(x, y, held):
    """log p(y of the trials held | y of the others) of jointly Gaussian measurements."""
    others = [i for i in range(len(x)) if i not in held]

    def log_p(trials):
        rows = x[trials].reshape(-1, 2)
        covariance = rows @ np.diag(PRIOR**2) @ rows.T + np.eye(len(rows))
        return multivariate_normal.logpdf(y[trials].ravel(), cov=covariance)

    return log_p([*others, *held]) - log_p(others)


@pytest.mark.parametrize("held", [[0], [1, 3]])
def test_it_is_the_predictive_density_where_all_is_linear(held):
    random = np.random.default_rng(1)
    x = random.standard_normal((4, 10, 2))
    y = x @ np.array([0.3, -2.0]) + random.standard_normal((4, 10))
    assert predicted(regression(x, y), held) == pytest.approx(exact(x, y, held), abs=1e-6)


def test_a_fit_loses_nothing_by_what_only_the_unseen_trials_determine_but_by_a_contradiction():
    random = np.random.default_rng(2)
    x, noise = random.standard_normal((4, 30, 2)), random.standard_normal((4, 30))
    x[:3, :, 1] = 0.0  # only the last trial determines the second parameter
    y = x @ np.array([0.3, 2.0]) + noise
    gain, expected = gain_unseen(regression(x, y, (0,)), regression(x, y), [3])
    assert gain > 0.5 * expected > 10.0
    x = random.standard_normal((4, 30, 2))
    y = x @ np.array([0.3, 2.0]) + noise
    assert gain_left_out(regression(x, y, (0,)), regression(x, y))[0] > 100.0
    y[3] = x[3] @ np.array([0.3, -2.0]) + noise[3]  # the others determine it, and it is wrong here
    assert gain_unseen(regression(x, y, (0,)), regression(x, y), [3])[0] < -10.0


def test_a_fit_reaches_the_optimum_of_all_trials_with_every_measurement_counted():
    flow = {"shear_x": 0.2, "gyre_11": 0.1, "gyre_21": -0.08, "gyre_22": 0.06}
    training = swim(fish(nonuniform_current=flow), kinds=("sines", "turn"))
    hypothesis = nominal_hypothesis(fish()).with_effect("nonuniform_current")
    origin = hypothesis.parametrization.origin()
    far = evaluate(hypothesis, origin, training.select([0]), Noise())
    near = on_all(far, training)
    assert climb(near, training, 10).log_posterior - near.log_posterior < NEAR_GAIN
    assert near.noise.gate_imu == near.noise.gate_camera == OPEN_GATE


@pytest.fixture(scope="module")
def swum():
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_a_robot_without_effects_has_its_nominal_parameters_free(swum):
    hypothesis = start_hypothesis(Robot(), swum, Noise())
    assert hypothesis.free == NOMINAL_FREE
    assert known_effects(hypothesis.robot) == ()


def test_own_effects_are_free_as_far_as_the_recordings_determine_them(swum):
    """The line is never taut and no command reaches the limit: free, the prior would take both away."""
    robot = (
        Robot().with_effect("rudder_offset", offset=0.06).with_effect("camera_latency", delay=0.03)
    )
    robot = robot.with_effect("tether", stiffness=0.3, length=4.0).with_effect(
        "rudder_saturation", limit=0.79
    )
    hypothesis = start_hypothesis(robot, swum, Noise())
    assert hypothesis.free == (*NOMINAL_FREE, "rudder_offset.offset", "camera_latency.delay")
    assert hypothesis.robot.effects["tether"] == robot.effects["tether"]
    assert set(hypothesis.names) == {
        "rudder_offset",
        "camera_latency",
        "tether",
        "rudder_saturation",
    }


def test_of_two_that_are_identifiable_only_together_one_is_held():
    """Mass times place: each is as unsure as its prior; the one is identifiable where the other is held. A drag stays free."""
    prior = np.array([0.5, 4.0, 4.0])
    normal = np.diag(1.0 / prior**2)
    normal[1:, 1:] += 1e4 * np.array([[1.0, 0.9], [0.9, 0.81]])
    assert identifiable(normal, prior, range(1, 3)) in ([0, 1], [0, 2])
    assert identifiable(np.diag(1.0 / prior**2), prior, range(1, 3)) == [0]
    assert identifiable(normal + 100.0 * np.eye(3), prior, range(1, 3)) == [0, 1, 2]


NO_LAW = Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4)


def test_a_tail_cut_finer_weighs_and_bends_as_before():
    coarse, fine = fish(3), with_links(fish(3), 5)
    for name in ("link_length", "link_mass", "link_drag_sway"):
        assert 5 * fine.parameters[name] == pytest.approx(3 * coarse.parameters[name])
    stiffness = coarse.parameters["tail_stiffness"] / 3
    assert fine.parameters["tail_stiffness"] / 5 == pytest.approx(stiffness)


def test_another_link_is_tried_where_this_number_explains_more_or_leaves_half_the_process_noise():
    best = made_fit(100.0, ratio=10.0)
    assert promises_more(made_fit(101.0, ratio=10.0), best)
    assert promises_more(made_fit(50.0, ratio=4.0), best)
    assert not promises_more(made_fit(50.0, ratio=6.0), best)
    far = made_fit(100.0, ratio=200.0)
    assert not promises_more(made_fit(50.0, ratio=50.0), far)
    assert promises_more(made_fit(101.0, ratio=50.0), far)


@pytest.mark.parametrize(("links", "needed"), [(2, 2), (1, None)])
def test_a_finer_tail_is_chosen_for_a_fish_that_has_one_and_for_no_other(links, needed):
    data = swim(fish(links), duration=4.0)
    task = make_task(data, GIVEN, names=("quadratic_drag",))
    hypothesis = nominal_hypothesis(GIVEN)
    origin = hypothesis.parametrization.origin()
    base = refit(hypothesis, origin, task.trials.searched, Noise(), CONTINUE)
    selection = Selection(base, (Round(base, (), {}),), ())
    found = better_order(selection, NO_LAW, task)
    assert (found and found.robot.links) == needed
    if needed:
        assert found.log_posterior > base.log_posterior + 100.0
        assert found.largest_ratio < base.largest_ratio


def test_parameters_of_the_robots_own_effects_stay_free_with_more_links():
    given = GIVEN.with_effect("rudder_offset", offset=0.05)
    data = swim(fish(rudder_offset={"offset": 0.05}), kinds=("sines",), duration=1.0)
    task = make_task(data, given, names=("quadratic_drag",))
    free = ("tail_stiffness", "rudder_offset.offset")
    hypothesis = replace(nominal_hypothesis(given, free[:1]), free=free)
    nominal = evaluate(hypothesis, np.zeros(2), data, Noise())
    assert fit_links(2, nominal, nominal, task).hypothesis.free == free


VOCABULARY = """quadratic_drag current nonuniform_current wall_effect tip_slip wake_memory wave_drag
sloshing hull_asymmetry tail_hardening tail_joint_damping dry_friction tether payload rotor_imbalance
rudder_lag rudder_delay rudder_backlash rudder_offset rudder_saturation rudder_gain rudder_placement
rotor_lag rotor_saturation battery_sag camera_latency camera_heading_offset camera_scale gyro_scale
imu_misalignment""".split()


def test_the_vocabulary_is_complete_and_every_name_has_a_kind():
    assert set(VOCABULARY) == set(candidates())
    assert {kind_of(name) for name in VOCABULARY} == {"physics", "actuator", "sensor"}
    assert known(["current", "tether", "current"]) == ("current", "tether")


def test_a_table_of_ones_own_adds_a_name():
    effects = {**EFFECTS, "mine": EFFECTS["quadratic_drag"]}
    assert "mine" in candidates(effects)
    assert kind_of("mine", effects) == "physics"
    assert "mine" not in candidates()


def reasons(experiment, why):
    return {name for name, reason in not_excited(experiment).items() if reason == why}


def test_what_is_not_excited_is_not_judged():
    still = swim(GIVEN, kinds=("straight", "straight"), duration=2.0)
    unseen = reasons(still, "the rudder never moved")
    assert {"rudder_lag", "rudder_gain", "rudder_placement"} <= unseen
    assert not {"rudder_offset", "current"} & set(not_excited(still))
    blind = replace(still, gyro=np.full_like(still.gyro, np.nan))
    assert not_excited(blind)["gyro_scale"] == "no IMU sample can be used"
    drifting = replace(still, commands=still.commands * [0.0, 1.0])
    rotor = {"rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"}
    assert reasons(drifting, "the rotor never moved") == rotor


def test_padding_is_no_command():
    still = swim(GIVEN, kinds=("straight", "straight"), duration=2.0)
    held = np.stack([still.commands[..., 0], np.full_like(still.commands[..., 1], 0.2)], axis=-1)
    held[150:, 1] = 0.0  # pads a trial of 1.5 s
    turned = replace(still, commands=held, steps=still.steps - [0, len(held) - 150])
    moving = {"rudder_lag", "rudder_delay", "rudder_backlash"}
    assert reasons(turned, "the rudder's command never changed") == moving


def test_held_out_trials_take_no_part():
    split = split_trials(swim(GIVEN, kinds=("sines",) * 7, duration=1.0))
    assert set(split.held_out).isdisjoint(split.training)
    assert {*split.search, *split.check} == set(split.training)
    assert set(split.search).isdisjoint(split.check)
    assert sorted((*split.training, *split.held_out)) == list(range(7))


def test_the_search_uses_the_four_training_trials_that_are_excited_most():
    data = swim(GIVEN, kinds=("sines",) * 9, duration=1.0)
    still = data.commands * np.isin(range(9), (0, 3, 4, 7, 8))[:, None]  # 2, 5 and 8 are held out
    split = split_trials(replace(data, commands=still))
    assert split.held_out == (2, 5, 8)
    assert split.search == (0, 3, 4, 7)
    assert split.check == (1, 6)


def test_held_out_trials_have_no_influence_on_what_is_searched():
    """Measured against one that steers far, a fast straight swim would excite more than a slow steered one."""
    data = swim(GIVEN, kinds=("sines",) * 9, duration=2.0)
    swing = np.sin(0.2 * np.arange(data.length))[:, None]
    rotor = np.where(np.arange(9) == 6, 25.0, np.where(np.arange(9) == 7, 0.0, 100.0)) * swing
    rudder = np.where(np.isin(np.arange(9), (4, 7)), 0.0, 0.3) * swing
    calm = replace(data, commands=np.stack([rotor, rudder], axis=-1))
    far = calm.commands.copy()
    far[:, 2, 1] = 0.78 * np.sign(swing[:, 0])
    steered = replace(calm, commands=far)
    assert split_trials(calm).search == split_trials(steered).search == (0, 1, 3, 6)


def test_padding_does_not_excite():
    """A steady circle of half the length is no step of the rudder."""
    data = swim(GIVEN, kinds=("sines",) * 6, duration=2.0)
    commands = np.stack([np.sin(0.2 * np.arange(data.length)), np.zeros(data.length)], axis=-1)
    commands = np.repeat(commands[:, None], 6, axis=1)
    commands[..., 1] = 0.3 * np.sin(0.1 * np.arange(data.length))[:, None]
    commands[:, 3] = [1.0, 0.4]
    commands[100:, 3] = 0.0
    steps = np.where(np.arange(6) == 3, 100, data.steps)
    strength = excitation(replace(data, commands=commands, steps=steps))
    assert strength[3] == pytest.approx(0.0, abs=1e-9)
    assert strength[0] > 1.0


def test_a_search_knows_which_training_trials_it_has_not_fitted():
    data = swim(GIVEN, kinds=("sines",) * 9, duration=1.0)
    split = split_trials(data)
    trials = trials_of(data, split)
    assert [trials.training.names[i] for i in trials.check] == [data.names[i] for i in split.check]
    assert {*trials.searched.names}.isdisjoint(trials.training.names[i] for i in trials.check)
