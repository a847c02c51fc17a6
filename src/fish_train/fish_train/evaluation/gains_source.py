"""Where gains come from: a policy, constants, or a schedule over wanted speed and curvature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.contract import OUTPUTS
from fish_control.control_law import Gains
from fish_control.policy import Policy

Array = NDArray[np.float64]
LOW = np.array([o.low for o in OUTPUTS])
HIGH = np.array([o.high for o in OUTPUTS])


class GainsSource(Protocol):
    """Gains for a batch of situations."""

    def gains(self, inputs: Array, speed: Array, curvature: Array) -> Gains:
        """Normalised policy inputs (B, 6), wanted speed (B,) [m/s], path curvature (B,) [1/m] -> gains, each (B,)."""


@dataclass(frozen=True)
class PolicyGains:
    """A weights file's policy, with a network or constant."""

    policy: Policy

    def gains(self, inputs: Array, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """The policy looks at its inputs only."""
        return self.policy.gains(inputs)


SPEED_MIDDLE, SPEED_SPAN = 0.2, 0.1  # m/s
CURVATURE_SPAN = 3.0  # 1/m


@dataclass(frozen=True)
class ScheduledGains:
    """Gains that follow wanted speed and curvature smoothly, kept in their ranges.

        gain = low + (high - low) / (1 + exp(-(a + b (u - 0.2) / 0.1 + c |kappa| / 3)))

    Attributes:
        coefficients: (6, 3) rows (a, b, c); b = c = 0 are constant gains.
    """

    coefficients: Array

    @classmethod
    def constant(cls, values: Array) -> ScheduledGains:
        """The same gains always; values (6,) inside the ranges."""
        share = np.clip((np.asarray(values, dtype=float) - LOW) / (HIGH - LOW), 1e-6, 1.0 - 1e-6)
        return cls(np.column_stack([np.log(share / (1.0 - share)), np.zeros((6, 2))]))

    def gains(self, inputs: Array, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """By wanted speed and curvature only."""
        features = np.stack([np.ones_like(speed), (speed - SPEED_MIDDLE) / SPEED_SPAN, np.abs(curvature) / CURVATURE_SPAN])
        exponent = np.clip(self.coefficients @ features, -50.0, 50.0)
        share = 1.0 / (1.0 + np.exp(-exponent))
        return Gains(*(LOW[:, None] + (HIGH - LOW)[:, None] * share))
