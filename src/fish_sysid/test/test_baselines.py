# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Predictors without mechanics: each finds a system of its own kind, and their inputs are what they are said to be."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.prediction.baselines import (
    STEP,
    Table,
    _travel,
    fit_arx,
    fit_bilinear,
    inputs,
)

Array = np.ndarray


def commanded(rotor: Array, rudder: Array) -> Experiment:
    steps = len(rotor)
    nothing = np.full((steps, 1), np.nan)
    frames = (Frames(np.zeros(0), np.zeros((0, 3))),)
    commands = np.stack([rotor, rudder], axis=-1)[:, None]
    return Experiment(
        ("a",),
        np.array([steps]),
        commands,
        nothing,
        np.full((steps, 1, 2), np.nan),
        nothing,
        frames,
        True,
    )


def test_throttle_is_the_share_of_full_strokes_and_a_still_rudder_is_itself_to_the_end() -> None:
    """Full throttle: 12 rad at 2 Hz. The square root of the throttle is the share of its acceleration."""
    t = 0.01 * np.arange(600)
    for share in (1.0, 0.5):
        speed = share * 12.0 * 4.0 * np.pi * np.sin(4.0 * np.pi * t)
        w = inputs(commanded(speed, np.full(600, 0.3)))
        np.testing.assert_allclose(w[100:-100, 0, 0], share, rtol=2e-3)
        np.testing.assert_allclose(w[:, 0, 1], 0.3, rtol=1e-12)


def test_inputs_are_averaged_over_as_much_as_the_stroke_means() -> None:
    """A step of the rudder passes through a half in its middle and is over half a second to both sides."""
    rudder = np.where(np.arange(401) < 200, 0.0, 0.4)
    w = inputs(commanded(np.zeros(401), rudder))[:, 0, 1]
    assert w[150] == pytest.approx(0.0, abs=1e-12)
    assert w[250] == pytest.approx(0.4)
    assert 0.5 * (w[199] + w[200]) == pytest.approx(0.2, abs=1e-9)
    assert np.all(np.diff(w) >= -1e-12)


def excited(step, trials: int = 3, length: int = 60) -> list[Table]:
    """Trials of a system y_k+1 = step(y_k, y_k-1, w_k+1, w_k) under random inputs."""
    random, out = np.random.default_rng(0), []
    for _ in range(trials):
        w = np.column_stack([random.uniform(0.2, 0.8, length), random.uniform(-0.5, 0.5, length)])
        y = np.zeros((length, 3))
        y[:2] = 0.1 * random.standard_normal((2, 3))
        for k in range(1, length - 1):
            y[k + 1] = step(y[k], y[k - 1], w[k + 1], w[k])
        y[:2] = np.nan  # as where the camera does not cover the window
        out.append(Table(y, w))
    return out


def assert_follows(advance, data: list[Table]) -> None:
    for d in data:
        ahead = advance(d.y[3:-1], d.y[2:-2], d.w[4:], d.w[3:-1])
        np.testing.assert_allclose(ahead, d.y[4:], atol=2e-4)


def test_the_linear_model_finds_a_linear_system() -> None:
    random = np.random.default_rng(1)
    A1, A2 = (
        np.diag([0.6, 0.3, 0.4]) + 0.05 * random.standard_normal((3, 3)),
        0.1 * random.standard_normal((3, 3)),
    )
    B1, B2 = 0.1 * random.standard_normal((2, 3, 2))
    c = np.array([0.01, -0.02, 0.03])

    def step(y: Array, before: Array, w: Array, w_before: Array) -> Array:
        return A1 @ y + A2 @ before + B1 @ w + B2 @ w_before + c

    data = excited(step)
    assert_follows(fit_arx(data), data)


def test_the_bilinear_model_finds_a_fish_that_turns_with_rudder_times_speed() -> None:
    def step(y: Array, before: Array, w: Array, w_before: Array) -> Array:
        u = y[0] + STEP * (0.01 - 0.8 * y[0] + 0.3 * 0.5 * (w[0] + w_before[0]))
        r = 0.02 + 1.5 * w[1] * u + 0.7 * w_before[1] * y[0] + 0.3 * y[2]
        return np.array([u, -0.05 * r, r])

    data = excited(step)
    assert_follows(fit_bilinear(data), data)


def test_velocities_of_the_body_add_up_to_a_way_through_the_pool() -> None:
    """Constant surge, sway and turn: the arc in closed form. Rising speed: the mean of both ends."""
    (u, v, r), psi0 = (0.2, 0.05, 0.8), 2.0
    y, start = np.array([[u, v, r]]), np.array([[1.0, -1.0, psi0]])
    x, y_end, psi = _travel(start, y, y)[-1, 0]
    end = psi0 + r * STEP
    assert psi == pytest.approx(end)
    across = (u * (np.sin(end) - np.sin(psi0)) + v * (np.cos(end) - np.cos(psi0))) / r
    up = (-u * (np.cos(end) - np.cos(psi0)) + v * (np.sin(end) - np.sin(psi0))) / r
    assert (x - 1.0, y_end + 1.0) == pytest.approx((across, up), abs=1e-6)
    faster = _travel(np.zeros((1, 3)), np.array([[0.1, 0.0, 0.0]]), np.array([[0.3, 0.0, 0.0]]))
    assert faster[-1, 0] == pytest.approx([0.2 * STEP, 0.0, 0.0])
