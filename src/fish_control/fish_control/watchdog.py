"""When the fish may swim: a verdict from the age and quality of what the controller is fed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fish_control.node_configs import ControllerConfig


@dataclass(frozen=True)
class Signs:
    """What the controller knows at one moment; None where nothing came yet."""

    odometry_age: float | None  # s since the stamp
    odometry_finite: bool
    pose_variance: float  # largest of x, y [m^2] and heading [rad^2]
    twist_variance: float  # largest of u, v [m^2/s^2] and r [rad^2/s^2]
    target_age: float | None  # s since the stamp


class Watchdog:
    """Stops on the first fault; goes on after all faults have been gone for `resume_delay`, or when told.

    Before the first motion it waits without calling it a fault.
    """

    def __init__(self, config: ControllerConfig) -> None:
        self._config = config
        self._good_since = math.inf
        self._released = False
        self.state: Literal["waiting", "swimming", "stopped"] = "waiting"
        self.reason = "waiting for odometry"
        self.stops = 0

    def check(self, now: float, signs: Signs) -> bool:
        """Whether the fish may swim at `now` [s]; `reason` says why not."""
        fault = self._fault(signs)
        if fault is not None:
            self._good_since = math.inf
            self._released = False
            self.reason = fault
            if self.state == "swimming":
                self.state = "stopped"
                self.stops += 1
            return False
        self._good_since = min(self._good_since, now)
        if self.state == "stopped" and not self._may_resume(now):
            return False
        self.state, self.reason = "swimming", "swimming"
        return True

    def release(self) -> str | None:
        """Allow motion again after a stop; None, or why not."""
        if self.state != "stopped":
            return f"not stopped but {self.state}"
        if self._good_since == math.inf:
            return self.reason
        self._released = True
        return None

    def _may_resume(self, now: float) -> bool:
        if self._released:
            self._released = False
            return True
        if self._config.resume == "auto":
            return now - self._good_since >= self._config.resume_delay
        self.reason = "all is well again; call resume"
        return False

    def _fault(self, signs: Signs) -> str | None:
        if signs.odometry_age is None:
            return "waiting for odometry"
        if not signs.odometry_finite:
            return "odometry is not finite"
        if signs.odometry_age > self._config.odometry_timeout:
            return _stale("odometry", signs.odometry_age, self._config.odometry_timeout)
        if not signs.pose_variance <= self._config.largest_variance:
            return "camera lost: fusion does not vouch for the pose"
        if not signs.twist_variance <= self._config.largest_variance:
            return "IMU lost: fusion does not vouch for the velocity"
        if signs.target_age is None:
            return "waiting for a target"
        if signs.target_age > self._config.target_timeout:
            return _stale("target", signs.target_age, self._config.target_timeout)
        return None


def _stale(name: str, age: float, allowed: float) -> str:
    return f"{name} is stale: {age:.2f} s old, {allowed:g} s allowed"
