# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message types: text and hash as ROS 2 Jazzy defines them, fields as a recording or else the common interfaces define them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fish_bag.problem import RecordingError
from fish_bag.storage import StoredTopic

IDL_PARTS = "=" * 80 + "\n"


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


def types_of(topic: StoredTopic) -> tuple[Typesdict, str]:
    """Types by name with which the topic's messages are decoded, and what is wrong with the definition ("": nothing)."""
    return _types(topic.type, topic.encoding, topic.definition, topic.serialization == "ros1")


@lru_cache(maxsize=256)
def _types(name: str, encoding: str, definition: bytes, ros1: bool) -> tuple[Typesdict, str]:
    """The same texts come again with every trial of a data set."""
    types: Typesdict = dict(typestore(ros1).fielddefs)
    if not definition.strip():
        return types, ""
    try:
        text = definition.decode()
        if encoding in ("ros2msg", "ros1msg"):
            types.update(get_types_from_msg(text, name))
        elif encoding in ("ros2idl", "omgidl"):
            types.update(_from_idl(text))
        else:
            return types, f"its definition is written in {encoding or 'an unknown language'!r}"
    except Exception as error:  # the parser raises its own errors and, on odd texts, any other
        said = " ".join(str(error).split())[:200]
        return dict(typestore(ros1).fielddefs), f"its definition cannot be parsed ({said})"
    return types, ""


def _from_idl(text: str) -> Typesdict:
    types: Typesdict = {}
    for part in text.split(IDL_PARTS):
        idl = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
        if idl.strip():
            types.update(get_types_from_idl(idl))
    return types
