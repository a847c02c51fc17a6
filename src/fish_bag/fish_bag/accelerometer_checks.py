# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Unit and axes of the accelerometer: gravity along z, the camera's path along x and y."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fish_bag.felt_acceleration import DIRECTIONS, FITS, RECORDED, SURE, FeltAcceleration
from fish_bag.problem import Problem
from fish_bag.record_comparison import FEWEST
from fish_bag.trial import Imu

GRAVITY = 9.81  # m/s^2
UNITS = {1.0: "g", 1000.0: "thousandths of g", 981.0: "cm/s^2", 32.19: "feet/s^2"}


def check_gravity(imu: Imu) -> Iterator[Problem]:
    """Specific force of a robot that is not thrown about is gravity, upwards."""
    force = np.median(imu.accel, axis=0)
    size = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    if not np.isfinite(size) or len(imu) < FEWEST:
        return
    if not 0.7 * GRAVITY < size < 1.4 * GRAVITY:
        close = [name for value, name in UNITS.items() if 0.985 < size / value < 1.015]
        close += ["g"] if 0.7 < size < 1.4 else []
        guess = close[0] if close else "gravity taken out" if size < 0.3 * GRAVITY else ""
        held = f"specific force is {size:.3g} throughout{f' ({guess}?)' if guess else ''}"
        text = f"{held}; expected {GRAVITY} m/s^2, gravity included: publish m/s^2"
        yield Problem("error", "accel_unit", imu.topic, text)
        return
    if force[2] < 0.7 * size:
        axis = int(np.argmax(np.abs(force)))
        up = f"{'-' if force[axis] < 0 else '+'}{'xyz'[axis]}"
        text = (
            f"gravity lies along {up}, expected +z: axes are swapped or mirrored; "
            "turn them where the IMU is published"
        )
        yield Problem("error", "accel_axes", imu.topic, text)


def check_directions(imu: Imu, felt: FeltAcceleration) -> Iterator[Problem]:
    """The directions of x and y that the camera's path shows, if the recorded ones are ruled out."""
    best = felt.best
    most = felt.likelihood[best]
    if felt.correlation[best] < FITS or most - felt.likelihood[RECORDED] < SURE:
        return
    names = [
        best,
        *(n for n, log_l in felt.likelihood.items() if n != best and most - log_l < SURE),
    ]
    recorded = felt.correlation[RECORDED]
    turned = all(np.linalg.det(DIRECTIONS[name]) > 0 for name in names)
    remedy = "turn the axes in the IMU's driver"
    if not turned:
        remedy = "mend the sign in the IMU's driver, or in the camera's if its y is mirrored"
    text = (
        f"specific force fits the camera's path with {' or '.join(names)} (correlation "
        f"{felt.correlation[best]:.2f}, as recorded {recorded:.2f}); expected x forward, y left: "
        f"{remedy}"
    )
    yield Problem("error", "accel_axes", imu.topic, text)
