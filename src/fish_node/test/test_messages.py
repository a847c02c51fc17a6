# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes, the status log, and static frames."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RMWError
from rclpy.logging import get_logger
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fish_node.nodes.frames import static_transform
from fish_node.nodes.message_bytes import MessageBytes, exact_bytes, mark
from fish_node.nodes.quick_messages import READERS, from_bytes, read_stamp
from fish_node.nodes.status_log import QUIET_S, StatusLog

FRAMES = ["", "a", "pool", "fish_2/base_link", "Teich-ö", "x" * 255]


def heard(kind: type, data: bytes) -> Any:
    """What the callback of a raw subscription is handed."""
    messages: list[Any] = []
    from_bytes(kind, messages.append)(data)
    return messages[0]


@pytest.mark.parametrize("data", [b"", b"\0", b"\0\1\0\0short", b"\xff" * 40])
@pytest.mark.parametrize("kind", READERS)
def test_bytes_that_are_no_message_are_refused_with_a_line(kind: type, data: bytes) -> None:
    heard_, lines = [], []
    from_bytes(kind, heard_.append, lines.append)(data)
    assert heard_ == []
    assert lines[0].startswith(f"{len(data)} bytes are no {kind.__name__} and are not used")


def filled(message: Any, random: np.random.Generator) -> Any:
    """A message with a random number in every field of numbers, one of them none."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if kind == "double":
            setattr(message, name, float(random.choice([np.nan, -np.inf, random.normal()])))
        elif kind.startswith("double["):
            setattr(message, name, random.normal(size=len(value)))
        elif kind in ("int32", "uint32"):
            setattr(message, name, int(random.integers(0, 2**31)))
        elif kind != "string":
            filled(value, random)
    return message


def differing(quick: Any, message: Any) -> list[str]:
    """Names of the fields that are not the same; two values that are no number are the same."""
    found = []
    for name, kind in message.get_fields_and_field_types().items():
        got, expected = getattr(quick, name), getattr(message, name)
        if "/" in kind:
            found += differing(got, expected)
        elif kind == "string" or kind.startswith("sequence"):
            found += [name] if got != expected else []
        elif not np.array_equal(got, expected, equal_nan=True):
            found.append(name)
    return found


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("frame", FRAMES)
def test_every_field_is_as_rclpy_reads_it(kind: type, frame: str) -> None:
    random = np.random.default_rng(len(frame))
    for child in FRAMES:
        message = filled(kind(), random)
        message.header.frame_id = frame
        if kind is Odometry:
            message.child_frame_id = child
        data = serialize_message(message)
        assert differing(heard(kind, data), deserialize_message(data, kind)) == []


@pytest.mark.parametrize("kind", READERS)
def test_bytes_of_another_encapsulation_are_left_to_rclpy(kind: type) -> None:
    """Which cannot read them in the wheels, and says so."""
    data = b"\x7f\x7f" + serialize_message(kind())[2:]
    with pytest.raises(RMWError):
        deserialize_message(data, kind)
    lines: list[str] = []
    from_bytes(kind, lambda _: pytest.fail("it was read"), lines.append)(data)
    assert f"bytes are no {kind.__name__}" in lines[0]


def test_the_stamp_of_any_stamped_message_is_read() -> None:
    message = PoseWithCovarianceStamped()
    message.header.stamp = Time(sec=-3, nanosec=999_999_999)
    assert read_stamp(serialize_message(message)) == message.header.stamp
    big_endian = b"\x00\x00\x00\x00" + struct.pack(">iI", 7, 8)
    assert read_stamp(big_endian) == Time(sec=7, nanosec=8)


@pytest.mark.parametrize("kind", READERS)
def test_a_header_may_be_given_on(kind: type) -> None:
    message = filled(kind(), np.random.default_rng(1))
    header = heard(kind, serialize_message(message)).header
    assert type(kind(header=header).header) is type(message.header)
    assert header == message.header


FRAME_MESSAGES = ["", "a", "pool", "fish_2/base_link", "Teich-ö"]


def odometry(frame: str, stamp: Time, numbers: list[float]) -> Odometry:
    message = Odometry(header=Header(stamp=stamp, frame_id=frame), child_frame_id="base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = numbers[:2]
    message.pose.covariance[0], message.twist.covariance[35] = numbers[2:4]
    return message


@pytest.mark.parametrize("frame", FRAME_MESSAGES)
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


OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Console:
    """Stands for a logger and for the clock."""

    def __init__(self):
        self.time, self.said = 0.0, []
        self.log = StatusLog(self, lambda: self.time)

    def info(self, text):
        self.said.append(("info", text))

    def warning(self, text):
        self.said.append(("warning", text))

    def error(self, text):
        self.said.append(("error", text))

    def hear(self, seconds, *statuses):
        """A status each second, in turns."""
        for second in range(seconds):
            self.log.say(*statuses[second % len(statuses)])
            self.time += 1.0


def test_each_change_is_said_once_and_other_numbers_are_no_change():
    console = Console()
    for rate in range(20):
        console.hear(1, (WARN, f"running at {0.5 + rate / 100}, -{rate} s behind"))
    console.hear(5, (ERROR, "camera lost"))
    console.hear(5, (OK, "estimating"))
    assert console.said == [
        ("warning", "running at 0.5, -0 s behind"),
        ("error", "camera lost"),
        ("info", "estimating"),
    ]


def test_what_comes_and_goes_fills_no_log_and_the_last_word_holds():
    console = Console()
    seconds = round(10 * QUIET_S)
    console.hear(seconds, (WARN, "no image"), (OK, "running"))
    assert 2 < len(console.said) <= 2 * seconds / QUIET_S
    console.hear(round(QUIET_S) + 1, (WARN, "no image"))
    assert console.said[-1] == ("warning", "no image")


def test_one_logger_takes_every_level(capfd):
    """rclpy refuses two levels from one line of code."""
    log = StatusLog(get_logger("status_log"))
    for level in (OK, WARN, ERROR, OK):
        log.say(level, f"level {level!r}")
    said = "".join(capfd.readouterr())
    assert [word for word in ("[INFO]", "[WARN]", "[ERROR]") if word in said] == [
        "[INFO]",
        "[WARN]",
        "[ERROR]",
    ]


def test_a_transform_names_parent_and_child_and_holds_place_and_turn() -> None:
    message = static_transform("pool", "fish_2/camera", (0.1, 0.2, 3), (1, 0, 0, 0))
    assert (message.header.frame_id, message.child_frame_id) == ("pool", "fish_2/camera")
    place, turn = message.transform.translation, message.transform.rotation
    assert (place.x, place.y, place.z) == (0.1, 0.2, 3.0)
    assert (turn.x, turn.y, turn.z, turn.w) == (1.0, 0.0, 0.0, 0.0)
