# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What all the IMU's samples between two moments do to the strapdown state (see fish_control.strapdown).

Source: Forster et al., On-manifold preintegration, 2017, in the plane. Plain numbers: most intervals have one to four
steps, for which arrays cost many times as much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fish_control.imu_history import Step

Array = NDArray[np.float64]
SIZE = 8  # of the state


class Preintegration:
    """What the IMU's steps do to a state: the middle of each step counts for all of it.

    With dv = R(psi) (a - b) dt of a step and the time `left` after its middle, v moves by the sum of dv and p by the sum
    of left dv; the derivatives are sums too.

    Attributes:
        duration: s.
        turn: rad.
        dv, left_dv: sums (x, y) [m/s, m].
        parts: left, dv_x and dv_y of each step.
    """

    def __init__(self, x: Array, steps: Sequence[Step], accel_used: bool = True) -> None:
        """x: state at the start (8,); accel_used: False if the accelerometer drives nothing."""
        self.steps = steps
        self.duration = T = sum(step.dt for step in steps)
        _, _, psi, _, _, bias, bias_forward, bias_left = x.tolist()
        turn = since = known = dvx = dvy = left_dvx = left_dvy = 0.0
        since_dvx = since_dvy = both_dvx = both_dvy = 0.0  # sums of since dv and of left since dv
        along = left_along = across = left_across = (
            0.0  # sums of dt (c, s), which the biases move along
        )
        self.parts: list[tuple[float, float, float]] = []
        for dt, turned, _, forward, sideways, yaw_known, accel_known in steps:
            middle = since + 0.5 * dt
            left = T - middle
            turned = turned - bias * dt if yaw_known else 0.0  # without an IMU nothing is biased
            x_part = y_part = 0.0
            if accel_known and accel_used:
                angle = psi + turn + 0.5 * turned
                c, s = math.cos(angle) * dt, math.sin(angle) * dt
                ahead, aside = forward - bias_forward, sideways - bias_left
                x_part, y_part = c * ahead - s * aside, s * ahead + c * aside
                along, across = along + c, across + s
                left_along, left_across = left_along + left * c, left_across + left * s
            dvx, dvy = dvx + x_part, dvy + y_part
            left_dvx, left_dvy = left_dvx + left * x_part, left_dvy + left * y_part
            since_dvx, since_dvy = since_dvx + middle * x_part, since_dvy + middle * y_part
            both = left * middle
            both_dvx, both_dvy = both_dvx + both * x_part, both_dvy + both * y_part
            self.parts.append((left, x_part, y_part))
            turn, since = turn + turned, since + dt
            known += dt if yaw_known else 0.0
        self.turn, self.dv, self.left_dv = turn, (dvx, dvy), (left_dvx, left_dvy)
        self._since_dv, self._both_dv = (since_dvx, since_dvy), (both_dvx, both_dvy)
        self._along, self._left_along = (along, across), (left_along, left_across)
        self._known = known

    def jacobian(self) -> Array:
        """d x(end) / d x(start), (8, 8)."""
        (x, y), (left_x, left_y) = self.dv, self.left_dv
        (after_x, after_y), (both_x, both_y) = self._since_dv, self._both_dv
        (c, s), (left_c, left_s) = self._along, self._left_along
        T = self.duration
        return np.array(
            (
                (1.0, 0.0, -left_y, T, 0.0, both_y, -left_c, left_s),
                (0.0, 1.0, left_x, 0.0, T, -both_x, -left_s, -left_c),
                (0.0, 0.0, 1.0, 0.0, 0.0, -self._known, 0.0, 0.0),
                (0.0, 0.0, -y, 1.0, 0.0, after_y, -c, s),
                (0.0, 0.0, x, 0.0, 1.0, -after_x, -s, -c),
                (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
                (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
                (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            )
        )
