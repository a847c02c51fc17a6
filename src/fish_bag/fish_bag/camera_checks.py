# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's poses: single frames that no fish could have, unit and axes.

Unit and axes show in the size of the way, the direction of motion against the heading, and the accelerometer's scale.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from fish_bag.accelerometer_checks import FITS, FeltAcceleration
from fish_bag.problem import Problem
from fish_bag.record_comparison import (
    FOLLOWS,
    LENGTHS,
    SLOPES,
    STRAYS,
    Array,
    correlation,
    unit_problem,
)
from fish_bag.trial import Camera

NEIGHBOURS = 4  # on each side
POSITION_M, SPEED_M_S = (
    0.10,
    0.6,
)  # allowed distance from the neighbours: so much, and so much per second between
HEADING_RAD, TURN_RAD_S = 0.8, 3.0
LARGEST_WAY_M, LARGEST_SPEED_M_S = 50.0, 5.0  # of a fish in a pool
WAY_M, STEP_M = 0.3, 0.03  # m; way of the camera's pose that shows a direction, and steps of it
FEWEST_STEPS = 10
TURN_RAD = 0.05  # standard deviation of the heading from which it can be compared
HELD = 0.8  # length of the mean direction from which an angle is constant
CLEARER = (
    0.15  # by which the mean direction of a mirrored path must be longer than that of the path
)


def find_jumps(t: np.ndarray, x: np.ndarray, y: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """(N,) bool: pose far from the median of its neighbours in time.

    Sample i jumps if |p_i - median_j p_j| > POSITION + SPEED dt or |median_j wrap(psi_j - psi_i)| > HEADING
    + TURN dt, where j runs over the finite neighbours and dt is their median distance in time. Up to three
    bad frames in a row are found.

    Args:
        t, x, y, psi: (N,) in order of arrival [s, m, m, rad], NaN allowed (never a jump).
    """
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(psi))
    jumps = np.zeros(len(t), bool)
    if len(finite) < 2 * NEIGHBOURS:
        return jumps
    around = np.concatenate([np.arange(-NEIGHBOURS, 0), np.arange(1, NEIGHBOURS + 1)])
    place = np.arange(len(finite))[:, None] + around
    outside = (place < 0) | (place >= len(finite))
    j = finite[np.clip(place, 0, len(finite) - 1)]
    i = finite[:, None]
    dt = _median(np.abs(t[j] - t[i]), outside)
    distance = np.hypot(_median(x[j] - x[i], outside), _median(y[j] - y[i], outside))
    turn = np.abs(_median(np.mod(psi[j] - psi[i] + np.pi, 2 * np.pi) - np.pi, outside))
    jumps[finite] = (distance > POSITION_M + SPEED_M_S * dt) | (
        turn > HEADING_RAD + TURN_RAD_S * dt
    )
    return jumps


def _median(values: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """(N,) median over the neighbours that exist."""
    return np.nanmedian(np.where(outside, np.nan, values), axis=1)


def check_size(camera: Camera) -> Iterator[Problem]:
    """The way of a fish in a pool, in metres."""
    way = float(np.linalg.norm(np.ptp(_places(camera), axis=0)))
    speed = _median_speed(camera)
    if way > LARGEST_WAY_M or speed > LARGEST_SPEED_M_S:
        text = (
            f"poses cover {way:.3g} m at {speed:.3g} m/s; expected metres in a pool: "
            "another unit (cm, mm, pixels)? publish metres"
        )
        yield Problem("error", "camera_unit", camera.topic, text)


def check_unit(camera: Camera, felt: FeltAcceleration) -> Iterator[Problem]:
    """Accelerations of the poses against those felt, in whichever direction of the IMU's axes fits."""
    if felt.correlation[felt.best] < FITS:
        return
    low, high = sorted(felt.slopes[felt.best])
    if low < SLOPES[1] and high > SLOPES[0]:  # noise of one of them makes the slopes differ
        return
    text = "accelerations of the poses are {} times those that the accelerometer feels"
    slope = float(np.sqrt(low * high))
    yield from unit_problem("camera_unit", camera.topic, text, "metres", slope, LENGTHS)


def check_course(camera: Camera) -> Iterator[Problem]:
    """Heading against the direction of motion."""
    course, heading = _courses(camera)
    if len(course) < FEWEST_STEPS:
        return
    apart, together = np.exp(1j * (course - heading)).mean(), np.exp(1j * (course + heading)).mean()
    turned = float(np.angle(apart))
    mirrored = abs(together) > HELD and (
        abs(apart) < STRAYS or abs(together) - abs(apart) > CLEARER or _against(course, heading)
    )
    if mirrored:
        text = (
            f"the heading turns against the direction of motion (they agree to {abs(together):.2f} if x and y are "
            f"mirrored or swapped, to {abs(apart):.2f} as recorded); expected x, y, z right-handed, z up"
        )
        yield Problem("error", "camera_axes", camera.topic, text)
    elif abs(apart) > HELD and abs(turned) > np.pi / 4:
        text = (
            f"the heading lies {np.degrees(turned):.0f} deg from the direction of motion; expected 0: "
            "turn the marker's heading or the pool's axes"
        )
        yield Problem("error", "camera_heading", camera.topic, text)


def _places(camera: Camera) -> Array:
    return np.column_stack([camera.x, camera.y])


def _courses(camera: Camera) -> tuple[Array, Array]:
    """Direction of motion and heading on the way, one for every step of STEP_M [rad]."""
    xy = _places(camera)
    picked = [0]
    for i in range(1, len(xy)):
        if np.linalg.norm(xy[i] - xy[picked[-1]]) >= STEP_M:
            picked.append(i)
    steps = np.diff(xy[picked], axis=0)
    if len(steps) < 2 or STEP_M * len(steps) < WAY_M:
        return np.zeros(0), np.zeros(0)
    heading = [np.angle(np.exp(1j * camera.psi[a : b + 1]).mean()) for a, b in pairwise(picked)]
    return np.arctan2(steps[:, 1], steps[:, 0]), np.array(heading)


def _against(course: Array, heading: Array) -> bool:
    """Whether the direction of motion turns against the heading, also where both turn only a little."""
    course, heading = np.unwrap(course), np.unwrap(heading)
    wide = np.std(heading) > TURN_RAD and np.std(course) > TURN_RAD
    return bool(wide and correlation(course, heading) < -FOLLOWS)


def _median_speed(camera: Camera) -> float:
    steps = np.hypot(np.diff(camera.x), np.diff(camera.y))
    times = np.diff(camera.t)
    return float(np.median(steps[times > 0] / times[times > 0])) if (times > 0).any() else 0.0
