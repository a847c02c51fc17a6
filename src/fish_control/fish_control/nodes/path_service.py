# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paths as messages; start, feedback, cancel and result of following one, and where its progress is kept.

Services path/start and path/cancel (std_srvs/Trigger), topic path/status (diagnostic_msgs/DiagnosticStatus, transient local;
at every change and once a second): its message is waiting, executing, succeeded or canceled, its values are progress_m,
length_m and cross_track_m. Not an action: nav2_msgs is not among the wheels, and the common interfaces have none that fits.
"""

import os
import tempfile
from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

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


State = Literal["waiting", "executing", "succeeded", "canceled"]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FEEDBACK = ("progress_m", "length_m", "cross_track_m")


class PathService:
    """The planner's services, and what it says of its path.

    Args:
        node: the planner.
        start, cancel: do it and say what was done; raise ValueError with the reason otherwise.
    """

    def __init__(self, node: Node, start: Callable[[], str], cancel: Callable[[], str]) -> None:
        self.state: State | None = None
        self._status = node.create_publisher(DiagnosticStatus, "path/status", LATCHED)
        node.create_service(Trigger, "path/start", lambda _, answer: _answer(answer, start))
        node.create_service(Trigger, "path/cancel", lambda _, answer: _answer(answer, cancel))

    def say(self, state: State, values: dict[str, object]) -> None:
        """Publish the state and the feedback."""
        if state not in get_args(State):
            raise ValueError(f"state is {state!r}; known: {', '.join(get_args(State))}")
        self.state = state
        message = DiagnosticStatus(level=DiagnosticStatus.OK, name="path", message=state)
        message.values = [
            KeyValue(key=key, value=str(values[key])) for key in FEEDBACK if key in values
        ]
        self._status.publish(message)


def _answer(answer: Trigger.Response, act: Callable[[], str]) -> Trigger.Response:
    try:
        answer.success, answer.message = True, act()
    except ValueError as error:
        answer.success, answer.message = False, str(error)
    return answer
