# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a trial starts with the fish at rest, so that the filter may start with a small variance of its speed.

The first gyro sample shows whether the fish turns, the first encoder sample whether the rotor does. Only the camera sees a
straight glide, over some frames in which the first strokes push a fish at rest 3 cm as well. The accelerometer measures these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT

Array = NDArray[np.float64]

TURNS = 0.1  # rad/s, more than a gyro's bias
SPINS = 5.0  # rad/s of the rotor; strokes have tens and hundreds
FIRST_POSES = 0.3  # s
FEWEST_POSES = 3
# m in FIRST_POSES; at rest the recordings looked at have 14 mm at most, a fish at 0.1 m/s has 30
GLIDES = 0.02


def starts_at_rest(gyro: Array, accel: Array, encoder: Array, t: Array, pose: Array) -> bool:
    """Whether nothing moves at the first grid point of a trial.

    gyro (T,) [rad/s], accel (T, 2) level forward and left [m/s^2], encoder (T,) [rad/s], NaN where a sensor says nothing (no
    encoder and too few poses speak for rest, no gyro does not); pose (F, 3) of the camera at times t (F,) [s].
    """
    turns, spins = not abs(gyro[0]) < TURNS, abs(encoder[0]) >= SPINS
    early = t < FIRST_POSES
    if turns or spins or early.sum() < FEWEST_POSES:
        return not (turns or spins)
    pushed = _pushed(gyro, accel, float(np.median(pose[early][:FEWEST_POSES, 2])))
    moved = np.array(
        [np.interp(t[early], DT * np.arange(len(pushed)), along) for along in pushed.T]
    ).T
    # an image that is older than its stamp does not show the strokes yet that the accelerometer felt: less of the two counts
    return (
        min(_glide(t[early], pose[early, :2]), _glide(t[early], pose[early, :2] - moved)) < GLIDES
    )


def _pushed(gyro: Array, accel: Array, heading: float) -> Array:
    """(K, 2) how far [m] the forces of the first moments have moved the fish at each grid point, along the pool's axes."""
    count = round(FIRST_POSES / DT) + 1
    rate, (forward, left) = np.nan_to_num(gyro[:count]), np.nan_to_num(accel[:count]).T
    psi = heading + DT * np.cumsum(rate)
    cos, sin = np.cos(psi), np.sin(psi)
    force = np.column_stack([forward * cos - left * sin, forward * sin + left * cos])
    moved: Array = DT**2 * np.cumsum(np.cumsum(force, axis=0), axis=0)
    return np.concatenate([np.zeros((1, 2)), moved])


def _glide(t: Array, place: Array) -> float:
    """How far [m] a straight line through places (F, 2) at times t goes in FIRST_POSES."""
    velocity = np.polyfit(t - t.mean(), place, 1)[0]
    return FIRST_POSES * float(np.hypot(velocity[0], velocity[1]))
