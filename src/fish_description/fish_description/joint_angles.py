# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Angles of the fish's joints, as far as they are measured, commanded, or follow from the model. No ROS, no clock."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class JointAnglesConfig:
    """Parameters of the node."""

    rate_hz: float = 30.0  # messages per second
    tail_links: int = 3  # joints of the tail in the URDF
    tail_timeout: float = 0.5  # s, after which a measured tail is replaced by the resting one

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate_hz <= 200.0:
            raise ValueError(f"rate_hz: got {self.rate_hz:g}; expected 1 to 200 Hz")
        if not 1 <= self.tail_links <= 12:
            raise ValueError(f"tail_links: got {self.tail_links}; expected 1 to 12")
        if not 0.0 < self.tail_timeout < math.inf:
            raise ValueError(f"tail_timeout: got {self.tail_timeout:g}; expected above 0 s")


def tail_names(links: int) -> tuple[str, ...]:
    """Joints of the tail from the head to the fin, as camera/tail names them."""
    return tuple(f"tail_{k}" for k in range(1, links + 1))


class JointAngles:
    """The newest angle of every joint [rad], counter-clockwise positive but the rudder's, which is positive to the left.

    The rudder servo and the tail have no sensor of their own. The rudder is where it is commanded. The tail is what the
    camera sees; without it the tail's springs rest: joint 1 at minus the rudder's angle, the others straight (model
    description, tail springs).
    """

    def __init__(self, config: JointAnglesConfig) -> None:
        self._config = config
        self._rotor = self._rudder = 0.0
        self._tail: dict[str, float] = {}
        self._seen = -math.inf  # s

    def encoder(self, names: Sequence[str], positions: Sequence[float]) -> None:
        """Take joint_states: the rotor's measured angle."""
        self._rotor = _finite(names, positions).get("rotor", self._rotor)

    def command(self, names: Sequence[str], positions: Sequence[float]) -> None:
        """Take joint_command: the rudder's angle. The rotor's position in it is a phase, no angle."""
        self._rudder = _finite(names, positions).get("rudder", self._rudder)

    def camera(self, names: Sequence[str], positions: Sequence[float], now: float) -> None:
        """Take camera/tail, heard at `now` [s]."""
        if angles := _finite(names, positions):
            self._tail, self._seen = angles, now

    def angles(self, now: float) -> Mapping[str, float]:
        """Joint -> angle [rad] at `now` [s]; the same joints every time."""
        names = tail_names(self._config.tail_links)
        if now - self._seen <= self._config.tail_timeout:
            tail = {name: self._tail.get(name, 0.0) for name in names}
        else:
            tail = dict.fromkeys(names, 0.0)
            tail[names[0]] = -self._rudder
        return {"rotor": math.remainder(self._rotor, math.tau), "rudder": self._rudder, **tail}


def _finite(names: Sequence[str], positions: Sequence[float]) -> dict[str, float]:
    """Angles by name, without those that are missing or not finite."""
    pairs = zip(names, positions, strict=False)
    return {name: float(angle) for name, angle in pairs if math.isfinite(angle)}
