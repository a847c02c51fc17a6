# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters and their fits: refits, the global fit, the corrected and the surrogate model."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from made_fits import made_fit
from swims import fish, swim

from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.corrected_model import corrected, predicts_worse
from fish_sysid.diagnosis.prediction_rivals import with_rivals
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.diagnosis.surrogate_model import moving_effects, surrogate_model
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, Reach, better, estimate_noise, evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import (
    NOMINAL_FREE,
    Hypothesis,
    Parametrization,
    effect_class,
    extend,
    left_at_zero,
    nominal_hypothesis,
    start_values,
)
from fish_sysid.estimation.refit import (
    ANNEAL,
    ANNEAL_NEAR,
    ANNEAL_SHORT_HELD,
    REFIT,
    global_fit,
    multistart_fit,
    refit,
    refit_on,
)
from fish_sysid.estimation.shooting.left_out import Step
from fish_sysid.estimation.shooting.prediction_fit import with_links
from fish_sysid.estimation.shooting.schedule import Found
from fish_sysid.estimation.thresholds import SHORTEST_WRENCH
from fish_sysid.prediction.better_states import prediction_size

FREE = ("head_drag_surge", "head_drag_sway", "tail_stiffness")
TRUE = np.log([1.3, 0.8, 1.1])


@pytest.fixture(scope="module")
def data():
    return swim(fish(), kinds=("sines", "steps"))


@pytest.fixture(scope="module")
def best(data):
    return refit(nominal_hypothesis(Robot(links=1), FREE), TRUE, data, Noise(), REFIT)


def test_a_fit_without_a_likelihood_is_never_the_better_one():
    lost, low = made_fit(np.nan), made_fit(-5.0)
    assert better(lost, low) is low
    assert better(low, lost) is low


def test_annealing_reaches_from_the_nominal_values_what_a_refit_reaches_from_the_truth(data, best):
    found = refit(best.hypothesis, np.zeros(3), data, Noise(), ANNEAL)
    assert found.log_posterior > best.log_posterior - 5.0
    np.testing.assert_allclose(found.theta, best.theta, atol=0.05)


def test_parameters_of_a_large_effect_keep_their_values_while_annealing(data):
    hypothesis = nominal_hypothesis(Robot(links=1), FREE).with_effect("nonuniform_current")
    theta = np.full(len(hypothesis.free), 0.05)
    found = refit(hypothesis, theta, data, Noise(), ANNEAL_SHORT_HELD)
    np.testing.assert_array_equal(found.theta[3:], theta[3:])
    assert not np.allclose(found.theta[:3], theta[:3])


def test_a_fit_is_refitted_on_other_trials(data, best):
    more = swim(fish(), kinds=("random", "turn"), seed=1)
    assert refit_on(best, more).largest_ratio < 3.0


# a step away from the optimum of a tail of five links (logarithms)
ASIDE = {
    "head_added_mass_surge": 0.093,
    "head_added_mass_sway": 0.021,
    "head_inertia": 0.018,
    "link_inertia_factor": 0.034,
    "fin_added_mass_sway": 0.085,
    "fin_inertia_factor": 0.197,
    "tail_stiffness": 0.016,
    "rotor_inertia": 0.013,
    "head_drag_surge": 0.053,
    "head_drag_yaw": 0.025,
    "link_drag_surge": 0.436,
    "fin_drag_surge": -0.582,
    "fin_drag_sway": 0.185,
}


@pytest.mark.timeout(1200)  # of a loaded computer; a minute on a quiet one
def test_a_neighbouring_optimum_of_a_fine_tail_is_left_by_annealing_nearby():
    """Its optima lie so close together that a fit ends in a neighbour of the best."""
    robot = with_links(Robot(), 5)
    calm = Noise(gyro=0.003, accel=0.025, camera_position=0.001, camera_heading=0.006)
    swum = swim(robot, kinds=("sines", "random"), duration=6.0, seed=2, noise=calm)
    hypothesis, noise = nominal_hypothesis(robot), usual_noise(swum)
    truth = hypothesis.parametrization.origin()
    aside = truth + [ASIDE.get(name, 0.0) for name in hypothesis.free]
    stuck = refit(hypothesis, aside, swum, noise, REFIT)
    found = better(stuck, refit(hypothesis, stuck.theta, swum, noise, ANNEAL_NEAR))
    best = refit(hypothesis, truth, swum, found.noise, REFIT)
    assert best.log_posterior - stuck.log_posterior > 100.0
    assert abs(found.log_posterior - best.log_posterior) < 3.0


def recorded(links: int, seed: int) -> tuple[Hypothesis, Experiment, Fit]:
    """The nominal hypothesis, two trials of a fish up to 25 % away from it, and the fit from the truth."""
    random = np.random.default_rng(seed)
    robot = with_links(Robot(), links)
    ratios = random.uniform(0.75, 1.25, len(NOMINAL_FREE))
    ratios[NOMINAL_FREE.index("servo_rate_limit")] = 1.0
    values = {n: robot.parameters[n] * r for n, r in zip(NOMINAL_FREE, ratios, strict=True)}
    data = swim(robot.with_parameters(**values), kinds=("sines", "steps"), duration=4.0, seed=seed)
    hypothesis = nominal_hypothesis(robot)
    return hypothesis, data, refit(hypothesis, np.log(ratios), data, Noise(), REFIT)


def test_a_tail_of_one_link_is_fitted_as_well_as_from_the_truth() -> None:
    hypothesis, data, true = recorded(1, 0)
    assert global_fit(hypothesis, data, Noise()).log_posterior > true.log_posterior - 3.0


def test_many_starts_reach_the_truth_of_a_tail_of_three_links_where_one_does_not() -> None:
    hypothesis, data, true = recorded(3, 0)
    origin = hypothesis.parametrization.origin()
    single = refit(hypothesis, origin, data, Noise(), ANNEAL)
    found = multistart_fit(hypothesis, data, Noise())
    assert found.log_posterior > single.log_posterior + 100.0
    assert found.log_posterior > true.log_posterior - 3.0


def test_a_given_place_is_one_of_the_starts() -> None:
    """The stiffness is twenty times the nominal one, where no random start comes near."""
    stiff = Robot(links=1)
    stiff = stiff.with_parameters(tail_stiffness=20.0 * stiff.parameters["tail_stiffness"])
    data = swim(stiff, kinds=("sines", "steps"), duration=3.0)
    hypothesis = nominal_hypothesis(Robot(links=1), ("tail_stiffness",))
    place = np.log([20.0])
    found = multistart_fit(hypothesis, data, Noise(), places=[place])
    right = evaluate(hypothesis, place, data, Noise()).log_posterior
    assert found.log_posterior > right - 10.0
    assert multistart_fit(hypothesis, data, Noise()).log_posterior < right - 20.0


def test_a_slow_strong_force_is_found_from_a_fast_one() -> None:
    """The fish lies in a current that the model has not."""
    flow = {"mean_x": 0.0, "mean_y": 0.0, "strain": 0.05, "shear_x": 0.2, "shear_y": 0.1}
    robot = Robot(links=1).with_effect("nonuniform_current", **flow)
    data = swim(robot, kinds=("sines", "random"), seed=5)
    hypothesis = nominal_hypothesis(Robot(links=1))
    fast = replace(Noise().with_wrench(30.0), wrench_time=SHORTEST_WRENCH)
    slow = replace(Noise().with_wrench(16.0), wrench_time=2.0)
    fit = evaluate(hypothesis, np.zeros(len(hypothesis.free)), data, fast)
    found = estimate_noise(fit, data, reach=Reach.ANYWHERE)
    of_found, of_slow, of_fast = likelihoods(hypothesis, fit.theta, data, [found, slow, fast])
    assert of_found > of_slow > of_fast + 100.0


NOMINAL = ("head_drag_surge", "tail_stiffness")


@pytest.fixture(scope="module")
def several() -> Hypothesis:
    """Two nominal parameters, an effect of two, one with a place, and a sensor's error."""
    hypothesis = nominal_hypothesis(Robot(), NOMINAL)
    for name in ("current", "wall_effect", "camera_latency"):
        hypothesis = hypothesis.with_effect(name, 0.5)
    return hypothesis


@pytest.fixture(scope="module")
def coordinates(several: Hypothesis) -> Parametrization:
    return several.parametrization


@pytest.fixture
def theta(coordinates: Parametrization) -> np.ndarray:
    """Somewhere inside all ranges."""
    return coordinates.origin() + np.random.default_rng(0).uniform(
        -0.1, 0.1, len(coordinates.start)
    )


def test_values_come_back_and_stand_in_the_robot(
    coordinates: Parametrization, theta: np.ndarray
) -> None:
    values = coordinates.decode(theta)
    np.testing.assert_allclose(coordinates.encode(values), theta, atol=1e-12)
    robot = coordinates.robot(theta)
    np.testing.assert_allclose(coordinates.read(robot), values)
    by_name = dict(zip(coordinates.hypothesis.free, values, strict=True))
    assert robot.effects["current"] == {"x": by_name["current.x"], "y": by_name["current.y"]}
    assert robot.sensors["camera_latency"]["delay"] == by_name["camera_latency.delay"]
    assert robot.parameters["head_mass"] == Robot().parameters["head_mass"]


def test_nominal_parameters_are_free_in_their_logarithm_and_strengths_in_typical_ones(
    several: Hypothesis,
) -> None:
    origin = dict(zip(several.free, several.parametrization.origin(), strict=True))
    assert origin["head_drag_surge"] == origin["tail_stiffness"] == 0.0
    assert [origin[k] for k in ("current.x", "camera_latency.delay")] == pytest.approx([0.5, 0.5])
    assert abs(origin["current.y"]) == pytest.approx(0.5)
    twice = several.parametrization.decode(np.full(len(several.free), np.log(2.0)))[0]
    assert twice == pytest.approx(2.0 * Robot().parameters["head_drag_surge"])


def test_slopes_are_the_derivatives_of_what_the_filter_gets(
    coordinates: Parametrization, theta: np.ndarray
) -> None:
    p, dp, sensors = coordinates.filter_inputs(theta)
    for j, name in enumerate(coordinates.hypothesis.free):
        h = 1e-5 * np.eye(len(theta))[j]
        (up, _, s_up), (down, _, s_down) = (
            coordinates.filter_inputs(theta + h),
            coordinates.filter_inputs(theta - h),
        )
        np.testing.assert_allclose(dp[j], (up - down) / 2e-5, rtol=1e-6, atol=1e-9)
        if name == "camera_latency.delay":
            assert sensors.free == {"camera_latency": j}
            assert not dp[j].any()
            slope = (s_up.camera_latency - s_down.camera_latency) / 2e-5
            assert sensors.slope["camera_latency"] == pytest.approx(slope)
    assert p.shape == (dp.shape[1],)


def test_standard_errors_are_those_of_theta_times_the_slope(
    several: Hypothesis, coordinates: Parametrization, theta: np.ndarray
) -> None:
    """Correlated errors, against many draws of theta put through the parametrization."""
    random = np.random.default_rng(1)
    root = random.standard_normal((len(theta), len(theta)))
    covariance = 1e-6 * (root @ root.T + np.eye(len(theta)))
    fit = Fit(
        several,
        theta,
        coordinates.robot(theta),
        Noise(),
        np.zeros(1),
        0.0,
        SimpleNamespace(),
        np.linalg.inv(covariance),
    )
    drawn = random.multivariate_normal(theta, covariance, 20000)
    spread = np.array([coordinates.decode(t) for t in drawn]).std(axis=0)
    np.testing.assert_allclose(list(fit.standard_errors.values()), spread, rtol=0.03)
    assert list(fit.values) == list(fit.standard_errors) == list(several.free)


def test_theta_is_kept_in_the_physical_ranges(
    coordinates: Parametrization, theta: np.ndarray
) -> None:
    wild = coordinates.decode(
        coordinates.clip(theta + 500.0 * np.where(np.arange(len(theta)) % 2, 1.0, -1.0))
    )
    assert np.all((wild >= coordinates.lowest) & (wild <= coordinates.highest))
    delay = coordinates.hypothesis.free.index("camera_latency.delay")
    assert coordinates.lowest[delay] == 0.0  # an image cannot be of the future


def test_one_effect_more_leaves_the_others_where_they_are(
    several: Hypothesis, theta: np.ndarray
) -> None:
    more = several.with_effect("tether", 0.3)
    longer = extend(theta, more, "tether", 1.0, {"x": 0.4})
    values = dict(zip(more.free, more.parametrization.decode(longer), strict=True))
    np.testing.assert_array_equal(longer[: len(theta)], theta)
    parameters = effect_class("tether").parameters
    assert values["tether.stiffness"] == pytest.approx(parameters["stiffness"].typical)
    assert values["tether.x"] == pytest.approx(0.4)
    less = more.without("tether")
    assert less.free == several.free
    assert (
        less.names
        == several.names
        == (
            "current",
            "wall_effect",
            "camera_latency",
        )
    )


def test_numbers_that_are_held_stay_where_theta_has_them(
    several: Hypothesis, theta: np.ndarray
) -> None:
    """Of the robot, of an effect and of a sensor; the others keep their parametrization."""
    held = [several.free[0], "wall_effect.k", "camera_latency.delay"]
    rest = several.fixing(held, theta)
    moving = np.array([name not in held for name in several.free])
    assert rest.free == tuple(name for name in several.free if name not in held)
    assert rest.parametrization.robot(theta[moving]) == several.parametrization.robot(theta)
    assert several.fixing((), theta) == several


def test_only_strengths_start_at_a_fraction() -> None:
    wall = effect_class("wall_effect").parameters
    assert start_values(effect_class("wall_effect"), 0.0)["k"] == wall["k"].value
    half = start_values(effect_class("wall_effect"), 0.5)
    assert half["k"] == pytest.approx(0.5 * (wall["k"].value + wall["k"].typical))
    assert half["length"] == (
        wall["length"].value if wall["length"].typical is None else wall["length"].typical
    )
    with pytest.raises(ValueError, match="unknown effect 'magic'; known: "):
        effect_class("magic")


def test_a_parameter_of_zero_stays_zero_and_the_others_are_free() -> None:
    robot = Robot().with_parameters(fin_drag_surge=0.0, link_drag_surge=0.0)
    hypothesis = nominal_hypothesis(robot)
    left_out = {"fin_drag_surge", "link_drag_surge"}
    assert set(left_at_zero(robot)) == left_out == set(NOMINAL_FREE) - set(hypothesis.free)
    coordinates = hypothesis.parametrization
    with np.errstate(all="raise"):
        origin = coordinates.origin()
        moved = coordinates.robot(origin + 0.3)
    assert not origin.any()
    assert moved.parameters["fin_drag_surge"] == 0.0 < moved.parameters["fin_drag_sway"]
    assert nominal_hypothesis(Robot()).free == NOMINAL_FREE
    assert left_at_zero(Robot()) == ()


def test_a_robot_with_a_wrench_of_its_own_is_refused() -> None:
    """The filter's wrench takes its place; a motion without it would be another robot's."""
    with pytest.raises(
        UserError,
        match=r"robot 'carp' has the effect disturbance .* expected a robot without it; delete it",
    ):
        nominal_hypothesis(replace(Robot(), name="carp").with_effect("disturbance", sway=0.01))
    nominal_hypothesis(Robot().with_effect("disturbance"))


TRUTH = Robot(links=1)


@pytest.fixture(scope="module")
def swum() -> Experiment:
    random = np.random.default_rng(8)
    commands = np.stack([program(kind, 9.0, random) for kind in ("sines", "steps")], axis=1)
    return record(TRUTH, commands, Noise(), random)[0]


def fit_of(robot: Robot, experiment: Experiment) -> Fit:
    return evaluate(nominal_hypothesis(robot, ()), np.zeros(0), experiment, Noise())


def test_the_model_with_the_larger_errors_is_the_worse_one(swum: Experiment) -> None:
    slow = TRUTH.with_parameters(head_drag_surge=3.0 * TRUTH.parameters["head_drag_surge"])
    right, wrong = fit_of(TRUTH, swum), fit_of(slow, swum)
    assert predicts_worse(wrong, right, swum)
    assert not predicts_worse(right, wrong, swum)


def test_steps_that_are_each_as_good_do_not_add_up_to_a_worse_model(swum: Experiment) -> None:
    """What is written is compared with the refitted nominal model too, not only with what stands between them."""
    drag = TRUTH.parameters["head_drag_surge"]
    nominal, settled, surrogate = (
        fit_of(TRUTH.with_parameters(head_drag_surge=factor * drag), swum)
        for factor in (2.0, 2.04, 2.08)
    )
    assert not predicts_worse(settled, nominal, swum)
    assert not predicts_worse(surrogate, settled, swum)
    assert predicts_worse(surrogate, nominal, swum)
    search = {"final": nominal, "accepted": (), "task": SimpleNamespace(level=None)}
    lawless = SimpleNamespace(law=SimpleNamespace(lawful=lambda _: ""))
    found = SimpleNamespace(
        nominal=nominal, settled=settled, surrogate=surrogate, unseen=swum, state=lawless, **search
    )
    assert corrected(cast(Diagnosis, found)) is settled


def test_what_cannot_be_compared_is_not_worse(swum: Experiment) -> None:
    """No trial is long enough for a prediction over one second."""
    short = shorten(swum, 150)
    first, second = fit_of(TRUTH, short), fit_of(TRUTH, short)
    assert not predicts_worse(first, second, short)


SURROGATE_FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
WATER = Noise(wrench=(0.002, 0.004, 1e-4))
SURROGATE_NOMINAL = Robot(links=2)
SLIPPING = SURROGATE_NOMINAL.with_parameters(head_drag_surge=0.26).with_effect(
    "tip_slip", mobility=0.3
)
KINDS = ("sines", "random", "steps", "turn")


def recorded_for_surrogate(robot: Robot, seed: int) -> Experiment:
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, 9.0, random) for kind in KINDS], axis=1)
    return record(robot, commands, WATER, random)[0]


@pytest.fixture(scope="module")
def slipping() -> Experiment:
    return recorded_for_surrogate(SLIPPING, 4)


def nominal(experiment: Experiment) -> Fit:
    """Of a likelihood that was content with what it got."""
    hypothesis = nominal_hypothesis(SURROGATE_NOMINAL, SURROGATE_FREE)
    return evaluate(
        hypothesis, np.zeros(len(SURROGATE_FREE)), experiment, Noise(wrench=(0.1, 0.2, 0.01))
    )


@pytest.mark.timeout(600)
def test_what_helps_is_taken_and_unseen_trials_are_predicted(slipping: Experiment) -> None:
    """A sensor's error moves no fish, and is not tried."""
    start = nominal(slipping)
    names = ("camera_scale", "tip_slip", "tail_joint_damping")
    found, (asked,) = surrogate_model(start, names, slipping, lambda _: None)
    assert asked.step.name == "tip_slip"
    assert asked.step.gain > 2.0 * asked.step.deviation
    assert asked.step.p_value < 0.05
    assert not asked.rivals  # damped joints do not do as well in its place
    assert "tip_slip" in found.hypothesis.names
    assert "camera_scale" not in found.hypothesis.names
    assert found.values["tip_slip.mobility"] == pytest.approx(0.3, rel=0.15)
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)
    unseen = recorded_for_surrogate(SLIPPING, 5)
    before = prediction_size(unseen, start.robot, start.noise)
    # nine errors: position, heading and speed at three horizons, each at most half as large
    assert prediction_size(unseen, found.robot, found.noise) < before - 9.0 * np.log(2.0)


def test_what_the_robot_has_from_the_symmetries_is_no_candidate() -> None:
    drifting = SURROGATE_NOMINAL.with_effect("current", x=0.03, y=0.0)
    names = ("current", "tip_slip", "camera_latency")
    assert moving_effects(names, drifting) == ["tip_slip"]
    assert moving_effects(names, SURROGATE_NOMINAL) == ["current", "tip_slip"]


def test_an_effect_that_was_added_in_a_later_round_is_nobodys_rival(slipping: Experiment) -> None:
    steps = (
        Step("quadratic_drag", 0.3, 0.1, 2.0, added=True),
        Step("wave_drag", 0.1, 0.1, 2.0),
        Step("wave_drag", 0.3, 0.1, 2.0, added=True),
    )
    found = Found(nominal(slipping).hypothesis, np.zeros(len(SURROGATE_FREE)), np.inf)
    named = with_rivals(slipping, found, steps)
    assert [(n.step.name, n.rivals) for n in named] == [("quadratic_drag", {}), ("wave_drag", {})]


def test_a_fit_that_predicts_better_stays(slipping: Experiment) -> None:
    hypothesis = nominal_hypothesis(SLIPPING, SURROGATE_FREE)
    two = slipping.select([0, 1])
    true = evaluate(hypothesis, np.zeros(len(SURROGATE_FREE)), two, WATER)
    found, asked = surrogate_model(true, (), two, lambda _: None)
    assert not asked
    sizes = [prediction_size(two, fit.robot, fit.noise) for fit in (found, true)]
    assert sizes[0] <= sizes[1]
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)


def test_trials_too_short_to_predict_leave_the_fit_as_it_is(slipping: Experiment) -> None:
    start = nominal(short := shorten(slipping, 150))
    assert surrogate_model(start, ("tip_slip",), short, lambda _: None) == (start, ())
