# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where gains come from: a weights file's policy, or one of the baselines' forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.control_law import Gains
from fish_control.policy import Policy, policy_inputs
from fish_sim.ops import NUMPY
from fish_train.training.closed_loop_equations import gains_of, schedule_inputs
from fish_train.training.network import FORMS, split

Array = NDArray[np.float64]
# the values of `policy_inputs` in its order, each (B,)
Situation = tuple[Array, Array, Array, Array, Array, Array]


class GainsSource(Protocol):
    """Gains for a batch of situations."""

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:
        """Situations, wanted speed (B,) [m/s], path curvature (B,) [1/m] -> gains, each (B,)."""


@dataclass(frozen=True)
class PolicyGains:
    """A weights file's policy, with a network or constant."""

    policy: Policy

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """The policy looks at its inputs only, in the scales of its own contract."""
        inputs = policy_inputs(*situation, np, self.policy.contract.inputs)
        return self.policy.gains(np.stack(inputs, axis=-1))


@dataclass(frozen=True)
class ScheduledGains:
    """Gains that follow wanted speed and curvature smoothly: tanh(W x + b), scaled to the ranges.

    x = ((u - 0.2) / 0.1, |kappa| / 3); weights: flat (18,), W (6, 2) then b (6,).
    """

    weights: Array

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """By wanted speed and curvature only."""
        [(W, b)] = split(np.asarray(self.weights), FORMS["schedule"].layers)
        x = np.stack(schedule_inputs(speed, curvature, NUMPY), axis=-1)
        return gains_of(list(np.moveaxis(x @ W.T + b, -1, 0)), NUMPY)
