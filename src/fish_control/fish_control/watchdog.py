# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When the fish may swim: a verdict from the age and quality of what the controller is fed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fish_control.line_of_sight import Motion
from fish_control.node_configs import ControllerConfig
from fish_node.pool import FARTHEST

LARGEST_TWIST_VARIANCE = 1.0  # m^2/s^2, rad^2/s^2; fusion marks the twist without IMU with 1e4
# m, rad, m/s, rad/s
LARGEST_MOTION = Motion(FARTHEST, FARTHEST, math.pi, 5.0, 5.0, 50.0)
IMPLAUSIBLE = (
    f"odometry is not plausible: a value is not a number, or above {LARGEST_MOTION.x:g} m, {LARGEST_MOTION.surge:g} m/s or "
    f"{LARGEST_MOTION.yaw_rate:g} rad/s"
)
AHEAD = 0.1  # s, a stamp may be this far ahead of the clock: two machines' clocks are not quite the same


@dataclass(frozen=True)
class EstimateHealth:
    """What speaks for an estimate of the motion."""

    age: float  # s since the stamp
    plausible: bool  # every value is a number that a fish in a pool can have
    pose_variance: float  # largest of x, y [m^2] and heading [rad^2]
    twist_variance: float  # largest of u, v [m^2/s^2] and r [rad^2/s^2]


@dataclass(frozen=True)
class Health:
    """What the controller knows at one moment; None where nothing came yet."""

    estimate: EstimateHealth | None
    target_age: float | None  # s since the stamp
    twist_age: float | None  # s, of the target's speed and yaw rate
    error_age: float | None  # s, of the distance from the path
    disarmed: str = ""  # why the robot is not armed; empty while it may move


class Watchdog:
    """Pauses on the first fault; goes on after all faults have been gone for `resume_delay`.

    Whether a pause needs a person is not decided here: the owner of the arming state disarms after `pause_s`.

    Before the first motion, and while the robot is disarmed, it waits without calling it a fault.

    Attributes:
        fault: what is wrong now, of a fish that was stopped by it; empty when all is well again.
    """

    def __init__(self, config: ControllerConfig) -> None:
        self._config = config
        self._good_since = math.inf
        self.state: Literal["waiting", "swimming", "stopped"] = "waiting"
        self.reason = "waiting for odometry"
        self.stops = 0
        self.fault = ""

    def check(self, now: float, signs: Health) -> bool:
        """Whether the fish may swim at `now` [s]; `reason` says why not."""
        fault = self._fault(signs)
        self.fault = ""
        if fault is None and signs.disarmed:
            self.state, self.reason = "waiting", f"disarmed: {signs.disarmed}"
            return False
        if fault is not None:
            self._good_since = math.inf
            self.reason = fault
            if self.state == "swimming":
                self.state = "stopped"
                self.stops += 1
            self.fault = fault if self.state == "stopped" else ""
            return False
        self._good_since = min(self._good_since, now)
        if self.state == "stopped" and now - self._good_since < self._config.resume_delay:
            return False
        self.state, self.reason = "swimming", "swimming"
        return True

    def _fault(self, signs: Health) -> str | None:
        config = self._config
        if signs.estimate is None:
            return "waiting for odometry"
        fault = estimate_fault(signs.estimate, config.odometry_timeout, config.largest_variance)
        if fault is not None:
            return fault
        for name, age, waiting in (
            ("target", signs.target_age, "waiting for a target"),
            ("control/twist", signs.twist_age, "waiting for control/twist"),
            ("tracking/error", signs.error_age, "waiting for tracking/error"),
        ):
            if age is None:
                return waiting
            if fault := _age_fault(name, age, config.target_timeout):
                return fault
        return None


def is_plausible(motion: Motion) -> bool:
    """Whether every value is a number that a fish in a pool can have: one that is not would stay in what the control learns."""
    return all(abs(value) <= most for value, most in zip(motion, LARGEST_MOTION, strict=True))


def estimate_fault(signs: EstimateHealth, timeout: float, largest_variance: float) -> str | None:
    """What is wrong with an estimate, None if nothing is.

    timeout: s; largest_variance: m^2, rad^2 of the pose, which grows while the camera is lost.
    """
    if not signs.plausible:
        return IMPLAUSIBLE
    return _age_fault("odometry", signs.age, timeout) or loss(signs, largest_variance)


def loss(signs: EstimateHealth, largest_variance: float) -> str | None:
    """Which sensor an estimate of any age lacks, None if none; a variance that is no number is one too many."""
    if lost_pose := pose_loss(signs, largest_variance):
        return lost_pose
    if not signs.twist_variance <= LARGEST_TWIST_VARIANCE:
        return "IMU lost: fusion does not vouch for the velocity"
    return None


def pose_loss(signs: EstimateHealth, largest_variance: float) -> str | None:
    """The same for who needs no velocity."""
    if not signs.pose_variance <= largest_variance:
        return "camera lost: fusion does not vouch for the pose"
    return None


def _age_fault(name: str, age: float, allowed: float) -> str | None:
    if age > allowed:
        return f"{name} is stale: {age:.2f} s old, {allowed:g} s allowed"
    if age < -AHEAD:  # it would count as fresh for as long as its clock is ahead
        return f"{name} is from the future: stamped {-age:.2f} s ahead of this clock, {AHEAD:g} s allowed"
    return None
