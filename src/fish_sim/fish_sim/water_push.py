# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The water's random push on the head: an Ornstein-Uhlenbeck wrench in base_link, one command period at a time.

dW = -W dt / time + sqrt(2 / time) size dB, stationary standard deviation `size`; exact over a period (Gillespie 1996). The caller
draws the standard normal numbers, as many fish at once as it likes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT

Array = NDArray[np.float64]

SIMULATOR_TIME = 0.5  # s, correlation time in the simulator; assumption
SIMULATOR_ARM = 0.03  # m, moment about the head per force in the simulator; assumption
# of usual water, as in the supplied recordings: N, N, N m and s
USUAL_SIZE, USUAL_TIME = (0.003, 0.006, 1.5e-4), 0.2


@dataclass(frozen=True)
class WaterPush:
    """Surge force [N], sway force [N] and yaw moment [N m] on the head.

    size: (3,) standard deviations; time: correlation time [s], positive.
    """

    size: Array
    time: float

    @classmethod
    def of_force(cls, force: float) -> WaterPush:
        """The simulator's water from one number, the standard deviation of each force [N]."""
        return cls(force * np.array([1.0, 1.0, SIMULATOR_ARM]), SIMULATOR_TIME)

    @classmethod
    def usual(cls, factor: float = 1.0) -> WaterPush:
        """Usual water, `factor` times as strong."""
        return cls(factor * np.array(USUAL_SIZE), USUAL_TIME)

    def first(self, normal: Array) -> Array:
        """A wrench (..., 3) of the stationary distribution from standard normal numbers (..., 3)."""
        wrench: Array = self.size * normal
        return wrench

    def after(self, wrench: Array, normal: Array) -> Array:
        """The wrench (..., 3) a period of DT after `wrench`, from standard normal numbers (..., 3)."""
        kept = math.exp(-DT / self.time)
        return kept * wrench + math.sqrt(1.0 - kept**2) * self.size * normal
