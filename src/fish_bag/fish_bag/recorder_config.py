# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the recorder node, and which topics it takes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from fnmatch import fnmatchcase
from pathlib import Path

from fish_bag.bag_metadata import Qos

DEFAULT_TOPICS = (
    "joint_command",
    "joint_states",
    "imu/data",
    "camera/pose",
    "camera/tail",
    "camera/camera_info",
    "odometry/filtered",
    "reference/*",
    "control/*",
    "tracking/error",
    "path/status",
    "arming/*",
    "battery_state",
    "sim/odometry",
    "sim/joint_states",
    "/diagnostics",
    "/tf",
    "/tf_static",
    "/clock",
)


@dataclass(frozen=True)
class RecorderConfig:
    """ROS parameters of the recorder."""

    output: str = "recordings"  # folder in which every recording gets a folder of its own
    name: str = ""  # name of that folder; empty: fish_<date>_<time>
    robot: str = ""  # stored with the recording: which robot this was
    topics: tuple[str, ...] = (
        DEFAULT_TOPICS  # names or patterns, relative to the node's namespace or absolute
    )
    chunk_s: float = 0.5  # s; what a killed recorder loses at most, 0.05 to 1
    discovery_s: float = 0.1  # s; how often new topics are looked for, 0.02 to 5

    def __post_init__(self) -> None:
        if not self.output:
            raise ValueError("output = '': expected a folder")
        if "/" in self.name:
            raise ValueError(f"name = {self.name!r}: expected a folder name without /")
        if not any(self.topics):
            raise ValueError("topics = []: expected at least one name or pattern")
        if not 0.05 <= self.chunk_s <= 1.0:
            raise ValueError(f"chunk_s = {self.chunk_s}: expected 0.05 to 1 s")
        if not 0.02 <= self.discovery_s <= 5.0:
            raise ValueError(f"discovery_s = {self.discovery_s}: expected 0.02 to 5 s")

    def directory(self, now: datetime) -> Path:
        """Folder of the recording that starts now."""
        return Path(self.output).expanduser() / (self.name or f"fish_{now:%Y%m%d_%H%M%S}")


def is_selected(topic: str, patterns: Iterable[str], namespace: str) -> bool:
    """Whether an absolute topic name matches a pattern; patterns without leading / stand in the namespace."""
    prefix = namespace.rstrip("/")
    return any(
        fnmatchcase(topic, pattern if pattern.startswith("/") else f"{prefix}/{pattern}")
        for pattern in patterns
        if pattern
    )


def common_qos(offered: Iterable[Qos]) -> Qos:
    """The strictest policies that all publishers of a topic meet, so that none of them is missed."""
    profiles = list(offered)
    return Qos(
        reliable=all(qos.reliable for qos in profiles),
        transient_local=all(qos.transient_local for qos in profiles),
        depth=1000,  # a burst must not push out what is not yet written
    )
