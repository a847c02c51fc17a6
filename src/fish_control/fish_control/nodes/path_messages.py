# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paths as messages, and where the planner's path and progress are kept."""

import os
import tempfile
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

from fish_control.node_configs import PlannerConfig
from fish_control.nodes.messages import to_quaternion
from fish_control.paths import make_path, read_arguments
from fish_control.reference_path import PathError, ReferencePath

PATH_STEP = 0.02  # m between poses of the published path


def check_frames(frames: set[str], pool: str) -> None:
    """Raise PathError if a path and its poses are in another frame than the pool's; a message by hand often names none."""
    if wrong := sorted(frames.difference({"", pool})):
        raise PathError(
            f"frame_id is {wrong[0][:60]!r}, expected {pool!r} or none; transform the path before it is sent"
        )


def configured_path(config: PlannerConfig) -> ReferencePath:
    """The path that the parameters name. Raises PathError."""
    arguments = read_arguments(config.path_args, "path_args")
    if config.end:
        arguments["end"] = config.end
    return make_path(config.path, **arguments)


def default_state_file(namespace: str) -> str:
    """One for each user, domain and fish; no name in a `namespace` such as /fish has a dot."""
    domain, fish = os.environ.get("ROS_DOMAIN_ID", "0"), namespace.replace("/", ".")
    return f"{tempfile.gettempdir()}/fish_planner_{os.getuid()}_{domain}{fish}.json"


def to_message(path: ReferencePath, frame: str, stamp: Any) -> Path:
    """Poses along the path, tangent as orientation; a closed path ends where it begins."""
    message = Path()
    message.header.frame_id, message.header.stamp = frame, stamp
    for s in np.linspace(0.0, path.length, max(int(path.length / PATH_STEP), 2) + 1):
        pose = PoseStamped(header=message.header)
        pose.pose.position.x, pose.pose.position.y = map(float, path.point(s))
        pose.pose.orientation = to_quaternion(float(path.heading_at(s)))
        message.poses.append(pose)
    return message
