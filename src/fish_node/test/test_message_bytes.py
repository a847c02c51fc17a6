# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A message that is written into its bytes is the message that rclpy would have written."""

from __future__ import annotations

import math

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fish_node.nodes.message_bytes import MessageBytes, exact_bytes, mark

FRAMES = ["", "a", "pool", "fish_2/base_link", "Teich-ö"]


def odometry(frame: str, stamp: Time, numbers: list[float]) -> Odometry:
    message = Odometry(header=Header(stamp=stamp, frame_id=frame), child_frame_id="base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = numbers[:2]
    message.pose.covariance[0], message.twist.covariance[35] = numbers[2:4]
    return message


@pytest.mark.parametrize("frame", FRAMES)
def test_every_number_is_in_its_place(frame: str) -> None:
    written = MessageBytes(odometry(frame, Time(), [mark(k) for k in range(4)]), 4)
    for stamp, numbers in (
        (Time(sec=1, nanosec=2), [0.0, -1.5, math.inf, 1e-300]),
        (Time(sec=-1, nanosec=999_999_999), [3.0, 2.0, 1.0, 0.0]),
    ):
        data = written(stamp, numbers)
        assert deserialize_message(data, Odometry) == odometry(frame, stamp, numbers)


def test_numbers_may_stand_in_another_order_than_their_marks() -> None:
    message = JointState(name=["rotor"], position=[mark(2), mark(0)], velocity=[mark(1)])
    data = MessageBytes(message, 3)(Time(sec=5), (10.0, 20.0, 30.0))
    read = deserialize_message(data, JointState)
    assert (list(read.position), list(read.velocity)) == ([30.0, 10.0], [20.0])


def test_without_numbers_only_the_stamp_changes() -> None:
    status = DiagnosticStatus(name="arming", message="armed")
    data = MessageBytes(DiagnosticArray(status=[status]), 0)(Time(sec=7, nanosec=8))
    read = deserialize_message(data, DiagnosticArray)
    assert read == DiagnosticArray(header=Header(stamp=Time(sec=7, nanosec=8)), status=[status])


@pytest.mark.parametrize(
    ("message", "size"),
    [
        (JointState(name=["rotor"], position=[1.0], velocity=[2.0]), 72),
        (JointState(name=["tail_1", "tail_2"], position=[1.0, 2.0]), 76),
        (JointState(), 36),
        (Odometry(), 708),
    ],
)
def test_nothing_is_left_behind_the_message(message: JointState | Odometry, size: int) -> None:
    """As CDR counts: 4 bytes of encapsulation, 8 of stamp, 4 before each string and sequence, numbers at multiples of 8."""
    data = exact_bytes(message)
    assert len(data) == size
    assert deserialize_message(data, type(message)) == message


@pytest.mark.parametrize("position", [[mark(0)], [mark(0), mark(1), mark(1)]])
def test_a_mark_that_is_missing_or_there_twice_is_refused(position: list[float]) -> None:
    with pytest.raises(ValueError, match=r"mark\(1\) stands [02] times"):
        MessageBytes(JointState(position=position), 2)
