# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is free and in which parametrization: there and back, slopes against differences, standard errors to first order."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import (
    NOMINAL_FREE,
    Hypothesis,
    Parametrization,
    effect_class,
    extend,
    nominal_hypothesis,
    start_values,
    zeros,
)

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
    assert set(zeros(robot)) == left_out == set(NOMINAL_FREE) - set(hypothesis.free)
    coordinates = hypothesis.parametrization
    with np.errstate(all="raise"):
        origin = coordinates.origin()
        moved = coordinates.robot(origin + 0.3)
    assert not origin.any()
    assert moved.parameters["fin_drag_surge"] == 0.0 < moved.parameters["fin_drag_sway"]
    assert nominal_hypothesis(Robot()).free == NOMINAL_FREE
    assert zeros(Robot()) == ()


def test_a_robot_with_a_wrench_of_its_own_is_refused() -> None:
    """The filter's wrench takes its place; a motion without it would be another robot's."""
    with pytest.raises(
        UserError,
        match=r"robot 'carp' has the effect disturbance .* expected a robot without it; delete it",
    ):
        nominal_hypothesis(replace(Robot(), name="carp").with_effect("disturbance", sway=0.01))
    nominal_hypothesis(Robot().with_effect("disturbance"))
