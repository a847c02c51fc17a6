# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start, feedback, cancel and result of following a path.

Services path/start and path/cancel (std_srvs/Trigger), topic path/status (diagnostic_msgs/DiagnosticStatus, transient local;
at every change and once a second): its message is waiting, executing, succeeded or canceled, its values are progress_m,
length_m and cross_track_m. Not an action: nav2_msgs is not among the wheels, and the common interfaces have none that fits.
"""

from collections.abc import Callable
from typing import Literal, get_args

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

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
