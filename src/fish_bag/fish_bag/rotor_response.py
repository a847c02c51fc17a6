# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the hull's yaw rate answers the rotor: a rotor that turns one way turns the hull the other way.

The cross-spectrum of rotor speed and yaw rate, averaged over blocks with a Hann window (Welch 1967), at the frequency of the
strokes. Gain |r / phi_dot| is the rotor's inertia over that of hull and water, far below 1; the phase lies near 180 deg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fish_bag.record_comparison import GRID_S, Array, common_grid

BLOCK_S = 2.0
LEAST_SPEED = 3.0  # rad/s rms; the rotor strokes


@dataclass(frozen=True)
class RotorResponse:
    """At the frequency at which the rotor's speed varies most."""

    gain: float  # (rad/s) / (rad/s)
    phase: float  # rad in (-pi, pi]
    coherence: float  # 0 to 1
    swing: float  # rad, amplitude of the rotor's angle at this frequency
    share: float  # of the yaw rate's power that lies at this frequency, 0 to 1


def rotor_response(
    t_rotor: Array, rotor_speed: Array, t_rate: Array, rate: Array
) -> RotorResponse | None:
    """The response of a yaw rate (M,) at times (M,) to a rotor speed (N,) at times (N,); None: too short, or no strokes."""
    t, block = common_grid(t_rotor, t_rate), round(BLOCK_S / GRID_S)
    if len(t) < 2 * block:
        return None
    records = np.stack([np.interp(t, t_rotor, rotor_speed), np.interp(t, t_rate, rate)])
    if np.std(records[0]) < LEAST_SPEED:
        return None
    blocks = np.lib.stride_tricks.sliding_window_view(records, block, axis=1)[:, :: block // 2]
    blocks = (blocks - blocks.mean(axis=2, keepdims=True)) * np.hanning(block)
    rotor, hull = np.fft.rfft(blocks, axis=2)[:, :, 1:]
    power = (np.abs(rotor) ** 2).sum(axis=0)
    at = int(np.argmax(power))
    yaw = (np.abs(hull) ** 2).sum(axis=0)
    cross = (hull[:, at] * np.conj(rotor[:, at])).sum()
    coherence = float(abs(cross) ** 2 / (power[at] * yaw[at])) if yaw[at] else 0.0
    share = float(yaw[max(0, at - 1) : at + 2].sum() / yaw.sum()) if yaw.any() else 0.0
    frequency = (at + 1) / BLOCK_S
    swing = float(np.sqrt(2.0) * np.std(records[0]) / (2.0 * np.pi * frequency))
    return RotorResponse(
        float(abs(cross) / power[at]), float(np.angle(cross)), coherence, swing, share
    )
