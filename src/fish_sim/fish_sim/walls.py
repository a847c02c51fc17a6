# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's walls: they stop the centre of the fish's head, and count how often it came to them.

|x| <= LENGTH / 2,   |y| <= WIDTH / 2          pool frame
beyond a wall: the coordinate is the wall's, the velocity along its normal is 0   (plain inelastic contact)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fish_sim.pool import LENGTH, WIDTH

Array = NDArray[np.float64]

EDGE = np.array([LENGTH / 2, WIDTH / 2])  # m
APART = 1.0  # s that the fish is off all walls before its next touch is a new contact; it swings twice a second


class Walls:
    """Holds one fish inside the pool; `contacts` counts, `place` is where the newest contact began [m]."""

    def __init__(self) -> None:
        self.contacts = 0
        self.place = (math.nan, math.nan)
        self._touched = -math.inf

    def touches(self, time: float) -> bool:
        """Whether the contact goes on at `time` [s]."""
        return time - self._touched < APART

    def leave(self) -> None:
        """The fish was taken away: its next touch is a new contact."""
        self._touched = -math.inf

    def hold(self, time: float, position: Array, velocity: Array) -> NDArray[np.bool_]:
        """Stop position (2,) [m] and velocity (2,) [m/s] in place at `time` [s]; which of x and y a wall stopped."""
        stopped: NDArray[np.bool_] = np.abs(position) > EDGE
        if not stopped.any():
            return stopped
        if not self.touches(time):
            self.contacts += 1
            self.place = (
                float(np.clip(position[0], -EDGE[0], EDGE[0])),
                float(np.clip(position[1], -EDGE[1], EDGE[1])),
            )
        self._touched = time
        outward = stopped & (velocity * position > 0.0)
        position[stopped] = np.copysign(EDGE, position)[stopped]
        velocity[outward] = 0.0
        return stopped
