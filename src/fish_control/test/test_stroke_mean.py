# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The notch at the rotor's frequency."""

import casadi
import numpy as np
import pytest

from fish_control.stroke_mean import DAMPING, STROKE_FREQUENCY, StrokeState, stroke_step

W = 2.0 * np.pi * STROKE_FREQUENCY


def settle(rate, seconds=6.0, dt=0.01):
    """State and time after feeding a yaw rate and a sway r(t) of the same shape."""
    state = StrokeState()
    for t in np.arange(0.0, seconds, dt):
        state = stroke_step(state, rate(t), 0.1 * rate(t), dt)
    return state, t


@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_swing_at_the_stroke_is_taken_off_whole(dt):
    amplitude = 0.2  # rad
    worst = 0.0
    state = StrokeState()
    for k, t in enumerate(np.arange(0.0, 8.0, dt)):
        middle = t + 0.5 * dt  # the rate is held over the step
        state = stroke_step(state, amplitude * W * np.cos(W * middle), 0.0, dt)
        if k * dt > 4.0:
            worst = max(worst, abs(state.heading - amplitude * np.sin(W * (t + dt))))
    assert worst < 0.1 * amplitude


def test_steady_turn_is_delayed_by_the_stated_time():
    state, _ = settle(lambda t: 0.5)
    assert state.heading == pytest.approx(0.5 * 2.0 * DAMPING / W, rel=1e-3)
    assert state.heading_rate == pytest.approx(0.0, abs=1e-6)
    assert state.sway == pytest.approx(0.0, abs=1e-6)


def test_mean_of_sway_is_kept_and_its_swing_removed():
    state, t = settle(lambda t: 1.0 + 3.0 * np.cos(W * t))
    mean = 0.1 * (1.0 + 3.0 * np.cos(W * t)) - state.sway
    assert mean == pytest.approx(0.1, abs=0.03)


def test_casadi_and_numpy_give_the_same():
    symbols = casadi.SX.sym("z", 7)
    out = stroke_step(
        StrokeState(*(symbols[i] for i in range(4))), symbols[4], symbols[5], symbols[6]
    )
    function = casadi.Function("stroke", [symbols], list(out))
    values = np.random.default_rng(0).normal(size=7) * 0.1 + [0, 0, 0, 0, 0, 0, 0.3]
    here = stroke_step(StrokeState(*values[:4]), values[4], values[5], values[6])
    np.testing.assert_allclose([float(v) for v in function(values)], here, rtol=1e-12)
