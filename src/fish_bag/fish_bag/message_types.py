# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message definitions of ROS 2 Jazzy as recordings store them: text and hash by type name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from fish_bag.problem import RecordingError


@dataclass(frozen=True)
class MessageType:
    """A type as it stands in an MCAP schema and in metadata.yaml."""

    name: str  # "sensor_msgs/msg/Imu"
    definition: bytes  # concatenated text of the type and those it uses
    hash: str = ""  # RIHS01, "" if not known
    encoding: str = "ros2msg"  # of the definition
    serialization: str = "cdr"  # of the messages


@lru_cache(maxsize=2)
def typestore(ros1: bool = False) -> Typestore:
    """rosbags' types of ROS 2 Jazzy or ROS 1 Noetic."""
    return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)


@lru_cache(maxsize=256)
def message_type(name: str) -> MessageType:
    """Look a type up.

    Raises:
        RecordingError: not one of the common interfaces.
    """
    if name not in typestore().fielddefs:
        raise RecordingError(
            f"message type {name!r} is not one of the common interfaces of ROS 2 Jazzy"
        )
    text, _ = typestore().generate_msgdef(name, ros_version=2)
    return MessageType(name, text.encode(), typestore().hash_rihs01(name))


def ros2_type_name(name: str) -> str:
    """ROS 2's spelling of a type name: "sensor_msgs/Imu" of ROS 1 becomes "sensor_msgs/msg/Imu"."""
    return name.replace("/", "/msg/") if name.count("/") == 1 else name
