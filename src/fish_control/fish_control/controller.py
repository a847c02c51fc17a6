# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The controller: motion and plan in; gains, rudder and rotor commands out. No ROS, no clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fish_control import scalar_math
from fish_control.control_law import (
    ActuatorState,
    ControlState,
    Errors,
    Gains,
    Setpoint,
    actuator_step,
    control_step,
)
from fish_control.line_of_sight import (
    GuidanceState,
    Motion,
    MotionObserver,
    has_listened,
    heading_error,
    mean_heading,
    observe,
    through_water,
)
from fish_control.policy import Policy, policy_inputs

STANDING_SPEED = 0.02  # m/s, a gliding fish that is slower has stopped
RELEASE_RATE = 0.2  # rad/s, of a rudder that is let go
SEAM = 0.7  # rad, more than the head swings
LONGEST_PERIOD = 0.05  # s, of commands; after a stall the rotor's phase goes on from where it was


class Command(NamedTuple):
    """One joint command."""

    phase: float  # rad, of the rotor's oscillation
    rotor_speed: float  # rad/s, phi_dot
    alpha: float  # rad, rudder


@dataclass(frozen=True)
class Reference:
    """The planner's wishes."""

    course: float  # rad
    speed: float  # m/s
    yaw_rate: float  # rad/s, speed times curvature
    cross_track_error: float  # m


class Controller:
    """Runs a policy and the control law; `rest` stops the fish smoothly."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._limits = policy.contract.limits
        self._bounds = np.zeros(6), np.full(6, np.inf)
        self._guidance = policy.contract.guidance
        self._motion: Motion | None = None
        self._observer = MotionObserver(GuidanceState(), self._observe)
        self._control = ControlState()
        self._setpoint = Setpoint(0.0, 0.0)
        self._actuators = ActuatorState()
        self._glides = True
        self._listened, self._swims = 0.0, False

    def limit_gains(self, lowest: Sequence[float], highest: Sequence[float]) -> None:
        """From now on no gain below or above these (6,), in the order of Gains."""
        self._bounds = np.array(lowest), np.array(highest)

    def observe(self, time: float, motion: Motion) -> None:
        """Take in odometry stamped `time` [s]; call it with every message."""
        self._motion = motion
        self._observer.add(time, motion)

    def _observe(self, state: GuidanceState, motion: Motion, dt: float) -> GuidanceState:
        self._listened += dt
        return observe(state, motion, self._setpoint, dt, self._limits, self._guidance, scalar_math)

    def decide(self, wanted: Reference) -> Gains:
        """One control period at a wanted speed above zero: errors, gains from the policy, new set-points.

        Before the first stroke the set-points stay at rest until the fish `has_listened`.
        """
        if self._motion is None:
            raise ValueError("decide() before any odometry was observed")
        motion = self._motion
        state, curvature = self._observer.state, wanted.yaw_rate / wanted.speed
        water = through_water(state, wanted.course, curvature, wanted.speed, scalar_math)
        e_psi = continued(
            self._control.heading_error,
            float(heading_error(state, motion, water, self._guidance, scalar_math)),
        )
        e_u = wanted.speed - motion.surge
        inputs = policy_inputs(
            mean_heading(state.stroke, motion),
            motion.surge,
            wanted.speed,
            e_psi,
            e_u,
            wanted.cross_track_error,
            scalar_math,
            self._policy.contract.inputs,
        )
        gains = Gains(*self._bounded(self._policy.gains(inputs)))
        self._swims = self._swims or bool(
            has_listened(self._listened, motion, self._guidance, scalar_math)
        )
        if not self._swims:
            self.rest()
            return gains
        errors = Errors(e_psi, e_u, water.curvature, water.speed, state.water.thrust)
        self._control, self._setpoint = control_step(
            self._control,
            errors,
            gains,
            self._policy.contract.control_period,
            self._limits,
            scalar_math,
        )
        self._glides = True
        return gains

    def _bounded(self, gains: Gains) -> list[float]:
        lowest, highest = self._bounds
        bounded: list[float] = np.minimum(np.maximum(gains, lowest), highest).tolist()
        return bounded

    def glide(self, yaw_rate: float, dt: float) -> None:
        """No drive for dt [s]; rudder hard over to the side of `yaw_rate` until the fish stands, then let go slowly.

        A held rudder brakes: 0.24 m ahead and 0.24 m aside from 0.2 m/s instead of 0.44 m straight on. Steering by
        the PID would flap the rudder and so go on swimming; a rudder let go at once would push off again.
        """
        self._control = ControlState()
        self._glides = (
            self._glides and self._motion is not None and self._motion.surge > STANDING_SPEED
        )
        if self._glides:
            alpha = math.copysign(self._limits.rudder_range, yaw_rate) if yaw_rate != 0.0 else 0.0
        else:
            held = self._setpoint.alpha
            alpha = math.copysign(max(abs(held) - RELEASE_RATE * dt, 0.0), held)
        self._setpoint = Setpoint(alpha, 0.0)

    def rest(self) -> None:
        """Rotor to a stop and rudder to the centre; the PIDs forget."""
        self._control, self._setpoint = ControlState(), Setpoint(0.0, 0.0)

    def command(self, dt: float) -> Command:
        """Advance the actuators by dt [s]."""
        self._actuators, rotor_speed = actuator_step(
            self._actuators, self._setpoint, dt, self._limits, scalar_math
        )
        return Command(
            math.fmod(self._actuators.phase, 2.0 * math.pi),
            float(rotor_speed),
            float(self._actuators.alpha),
        )


def continued(before: float, angle: float) -> float:
    """An error angle [rad] on the side it came from: a fish that faces backwards makes up its mind.

    Beyond +-pi by up to SEAM the angle keeps its sign, so that the head's swing does not throw the rudder.
    """
    unwrapped = before + math.remainder(angle - before, 2.0 * math.pi)
    return unwrapped if abs(unwrapped) <= math.pi + SEAM else angle
