# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parametrization of a hypothesis for predictions over seconds: priors by what is known of a parameter, and a quick stepper.

A likelihood needs the tail's mode to a part in a million, a prediction of stroke means does not: RK4 with as many steps in a
period as the robot's own modes need takes less than half of the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import nominal_parameters
from fish_sim.scheme import Scheme, stable_scheme
from fish_sim.step import Stepper
from fish_sysid.estimation.parametrization import KNOWLEDGE_PRIOR, Hypothesis, Parametrization

Array = NDArray[np.float64]

QUICK = Scheme("rk4", 1)
UNSTATED = "unknown"
ROUNDING = 1e-9  # of a logarithm and back: keeps a value at an end of its range inside it


class ShotParametrization(Parametrization):
    """`Parametrization` of a hypothesis whose robot is near theta."""

    def __init__(self, hypothesis: Hypothesis, theta: Array | None = None) -> None:
        super().__init__(hypothesis)
        known = hypothesis.robot.knowledge
        sigma = [KNOWLEDGE_PRIOR[known.get(name, UNSTATED)] for name in hypothesis.free]
        self.prior = np.where(self.is_log, sigma, self.prior)
        table = nominal_parameters(hypothesis.robot.links)
        for i, name in enumerate(hypothesis.free):
            if name in table:
                self.lowest[i] = max(self.lowest[i], table[name].lowest * (1.0 + ROUNDING))
                self.highest[i] = min(self.highest[i], table[name].highest * (1.0 - ROUNDING))
        self.stepper = quick_stepper(self, self.origin() if theta is None else theta)


def quick_stepper(coordinates: Parametrization, theta: Array) -> Stepper:
    """A stepper with the fewest steps of RK4 that are stable at theta (K,)."""
    robot = coordinates.robot(theta)
    return Stepper(robot.structure, stable_scheme(robot, QUICK))
