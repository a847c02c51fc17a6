# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mean motion of a body that swings once a stroke: a notch at the rotor's frequency.

The rotor swings the head by 0.1 to 0.3 rad at 2 Hz; fed back as it is, the swing would wag the rudder. The
swing z of the heading is what a band-pass lets through of the integrated yaw rate, the mean is the rest:

    z'' + 2 zeta w z' + w^2 z = 2 zeta w r        psi_mean = psi - z,  r_mean = r - z'

and the same for the sway velocity, whose swing is taken off in the same way. No angle is unwrapped, and a
steady turn is delayed by TURN_LAG = 2 zeta / w only (0.05 s at 2 Hz; a mean over one stroke would delay it by
0.25 s).

Measured in the closed loop with simulated sensors (letters R, S, I at 0.15 and 0.2 m/s): speed error 9 to 17 mm/s
and rudder motion 0.35 to 0.6 rad/s with the mean heading; 30 to 73 mm/s and 2.7 to 2.9 rad/s with the heading as
it is, because a wagging rudder swims by itself.

Written on generic scalars: numpy and CasADi run the same lines.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

STROKE_FREQUENCY = 2.0  # Hz, fixed by the throttle map of MODEL (A carries the throttle)
# zeta, half the notch's width: wider delays turns, narrower learns a new swing slowly
DAMPING = 0.3
# s, by which psi_mean is late in a steady turn
TURN_LAG = 2.0 * DAMPING / (2.0 * math.pi * STROKE_FREQUENCY)


class StrokeState(NamedTuple):
    """Band-pass states; all zero at rest."""

    heading: Any = 0.0  # z, rad
    heading_rate: Any = 0.0  # z', rad/s
    sway_integral: Any = 0.0  # m
    sway: Any = 0.0  # m/s


def stroke_step(
    state: StrokeState, yaw_rate: Any, sway: Any, dt: Any, frequency: float = STROKE_FREQUENCY
) -> StrokeState:
    """Advance by dt [s] with yaw rate [rad/s] and sway velocity [m/s] held over the step.

    Semi-implicit in z (stable for w dt < 2 / (1 + 2 zeta)).
    """
    w = 2.0 * math.pi * frequency
    band = 2.0 * DAMPING * w

    def advance(z: Any, z_rate: Any, drive: Any) -> tuple[Any, Any]:
        z_rate = (z_rate + dt * (band * drive - w * w * z)) / (1.0 + dt * band)
        return z + dt * z_rate, z_rate

    z, z_rate = advance(state.heading, state.heading_rate, yaw_rate)
    y, y_rate = advance(state.sway_integral, state.sway, sway)
    return StrokeState(z, z_rate, y, y_rate)
