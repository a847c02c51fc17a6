# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages read from their bytes have the values that rclpy reads."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RMWError
from rclpy.serialization import deserialize_message, serialize_message

from fish_node.nodes.quick_messages import READERS, from_bytes, read_stamp

FRAMES = ["", "a", "pool", "fish_2/base_link", "Teich-ö", "x" * 255]


def heard(kind: type, data: bytes) -> Any:
    """What the callback of a raw subscription is handed."""
    messages: list[Any] = []
    from_bytes(kind, messages.append)(data)
    return messages[0]


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
    with pytest.raises(RMWError):
        heard(kind, data)


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
