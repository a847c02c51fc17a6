# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The maximum-likelihood noise is found from near and far, along the ridge on which a few seconds of data leave it."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from fish_report.parallel import on_all_cores
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import (
    NOISE_MOVES,
    Reach,
    estimate_noise,
    octaves,
)
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import alternate


@pytest.fixture(scope="module")
def fish() -> Experiment:
    """A standing wave pushes it, which the model lacks."""
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 7.0, random) for kind in ("sines", "straight")], axis=1)
    hidden = Robot().with_effect("sloshing", sine=-0.02, cosine=0.01, frequency=0.77)
    return record(hidden, commands, Noise(), random)[0]


def fitted(fish: Experiment, noise: Noise) -> Fit:
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_sway"))
    return evaluate(drags, np.zeros(2), fish, noise)


def test_the_last_move_keeps_how_fast_the_force_changes() -> None:
    moved = NOISE_MOVES[-1](Noise(), 3.0)
    assert moved.wrench_time == pytest.approx(3.0 * Noise().wrench_time)
    rates = [np.square(n.wrench) / n.wrench_time for n in (moved, Noise())]
    np.testing.assert_allclose(*rates)


def test_a_force_thought_to_last_is_found_to_be_short(fish: Experiment) -> None:
    """From tau = 2 s at the right sigma^2 / tau: one at a time neither sigma nor tau could move."""
    short = alternate(fitted(fish, Noise()), fish)
    wrong = NOISE_MOVES[-1](short.noise, 2.0 / short.noise.wrench_time)
    long = alternate(fitted(fish, wrong), fish)
    assert long.log_posterior > short.log_posterior - 3.0
    assert long.noise.wrench_time < 1.0


@pytest.mark.parametrize("reach", [Reach.FAR, Reach.ANYWHERE])
def test_the_sensor_noise_of_the_fit_is_kept(fish: Experiment, reach: Reach) -> None:
    """The signals' roughness, from which one start takes it, would say less."""
    fit = alternate(fitted(fish, Noise()), fish)
    found = estimate_noise(replace(fit, noise=Noise()), fish, reach=reach)
    sensors = ("gyro", "accel", "camera_position", "camera_heading")
    assert [getattr(found, name) for name in sensors] == [
        getattr(Noise(), name) for name in sensors
    ]
    near = estimate_noise(fit, fish, reach=Reach.NEAR)
    values = likelihoods(fit.hypothesis, fit.theta, fish, [found, near])
    assert values[0] > values[1] - 10.0


def test_likelihoods_together_are_those_alone(fish: Experiment) -> None:
    fit = fitted(fish, Noise())
    noises = [Noise(), Noise(wrench=(0.1, 0.1, 0.001))]
    together = likelihoods(fit.hypothesis, fit.theta, fish, noises)
    alone = [evaluate(fit.hypothesis, fit.theta, fish, n).log_likelihood.sum() for n in noises]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def test_items_are_worked_on_in_their_order_and_an_error_is_raised() -> None:
    assert on_all_cores(lambda n: n * n, range(5)) == [0, 1, 4, 9, 16]
    with pytest.raises(ZeroDivisionError):
        on_all_cores(lambda n: 1 // n, [1, 0])


def test_a_parabola_leads_to_its_top_and_no_farther_than_two_octaves() -> None:
    """And no warning of NumPy reaches the user where the filter diverges."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert octaves(-1.0, 0.0, -1.0) == 0.0
        assert octaves(-4.0, 0.0, 0.0) == pytest.approx(0.5)
        assert octaves(0.0, 0.0, 5.0) == 2.0  # no top: uphill
        assert octaves(-np.inf, 0.0, 5.0) == 2.0
        assert octaves(-np.inf, 0.0, -np.inf) == 0.0
