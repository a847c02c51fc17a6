# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the live view shows of one robot, as one JSON document. No ROS, no network."""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fish_control.pool import HALF_LENGTH, HALF_WIDTH
from fish_report.printable import plain

TRAIL = 600  # poses: a minute of them
TRAIL_PERIOD = 0.1  # s
LEVELS = ("ok", "warn", "error", "stale")


@dataclass(frozen=True)
class ViewConfig:
    """Parameters of the live view."""

    address: str = "127.0.0.1"  # that the page is served on; 0.0.0.0: for other computers too
    port: int = 8080  # of the page
    foxglove_port: int = 8765  # of the websocket for Foxglove; 0: none
    control: bool = False  # true: the page's buttons arm and disarm; false: it only shows
    rate_hz: float = 10.0  # Hz, of the page

    def __post_init__(self) -> None:
        if not self.address:
            raise ValueError("address is '', expected an address such as 127.0.0.1")
        for name, low, high in (("port", 1, 65535), ("foxglove_port", 0, 65535)):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}, expected {low} to {high}")
        if not 1.0 <= self.rate_hz <= 30.0:
            raise ValueError(f"rate_hz is {self.rate_hz}, expected 1 to 30 Hz")


class ViewState:
    """Keeps the newest of what the robot says.

    Attributes:
        pose: x [m], y [m], heading [rad] in the pool. speed: surge [m/s].
        errors: cross-track [m], heading [rad], speed [m/s].
        gains: Kp, Ki, Kd of steering, then of speed. tail: relative angles of the links [rad].
        armed: None before anybody said. reason: why the robot is disarmed.
        path: points [m] of the wanted path.
    """

    def __init__(self, control: bool = False) -> None:
        self.control = control
        self.pose: tuple[float, float, float] | None = None
        self.speed = math.nan
        self.errors: Sequence[float] = ()
        self.gains: Sequence[float] = ()
        self.tail: Sequence[float] = ()
        self.armed: bool | None = None
        self.reason = ""
        self.path: list[tuple[float, float]] = []
        self._stamp = math.nan
        self._trail: deque[tuple[float, float]] = deque(maxlen=TRAIL)
        self._trail_stamp = -math.inf
        self._health: dict[str, tuple[int, str]] = {}

    def move(self, stamp: float, pose: tuple[float, float, float], speed: float) -> None:
        """Take an estimate stamped `stamp` [s]."""
        self._stamp, self.pose, self.speed = stamp, pose, speed
        if not 0.0 <= stamp - self._trail_stamp < TRAIL_PERIOD:
            self._trail_stamp = stamp
            self._trail.append(pose[:2])

    def health(self, node: str, level: int, message: str) -> None:
        """Take what a node says of itself; level as in diagnostic_msgs."""
        self._health[plain(node)] = (level, plain(message))

    def document(self, now: float) -> str:
        """The JSON that the page reads; `now` [s] on the clock of the stamps. Numbers that are none become null."""
        shown: dict[str, Any] = {
            "pool": [2.0 * HALF_LENGTH, 2.0 * HALF_WIDTH],
            "pose": self.pose,
            "age": now - self._stamp,
            "speed": self.speed,
            "errors": list(self.errors),
            "gains": list(self.gains),
            "tail": list(self.tail),
            "armed": self.armed,
            "reason": self.reason,
            "control": self.control,
            "path": self.path,
            "trail": list(self._trail),
            "health": [
                {"node": node, "level": LEVELS[min(level, 3)], "message": message}
                for node, (level, message) in sorted(self._health.items())
            ],
        }
        return json.dumps(_finite(shown), separators=(",", ":"))


def _finite(value: Any) -> Any:
    """JSON has neither NaN nor infinity."""
    if isinstance(value, float):
        return round(value, 5) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
