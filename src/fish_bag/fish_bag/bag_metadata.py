# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml of a rosbag2 directory (version 9, as ROS 2 Jazzy writes it)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import yaml

from fish_bag.message_types import MessageType
from fish_bag.qos import Qos


class RecordedTopic(Protocol):
    """What is said of a topic."""

    name: str
    message_type: MessageType
    qos: Qos
    count: int


def metadata_text(
    file_name: str,
    topics: Sequence[RecordedTopic],
    time_range: tuple[int, int] | None,
    custom: dict[str, str],
) -> str:
    """The text of metadata.yaml.

    Args:
        time_range: first and last arrival [ns], None without messages.
        custom: free key-value pairs stored with the recording.
    """
    first, last = time_range or (0, 0)
    count = sum(topic.count for topic in topics)
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        **_extent(first, last, count),
        "topics_with_message_count": [_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, **_extent(first, last, count)}],
        "custom_data": custom or None,
        "ros_distro": "jazzy",
    }
    text: str = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
    return text


def write_metadata(directory: Path, text: str) -> None:
    """Write `directory`/metadata.yaml in one step: a reader never sees half of it."""
    part = directory / "metadata.yaml.part"
    part.write_text(text)
    os.replace(part, directory / "metadata.yaml")


def _extent(first: int, last: int, count: int) -> dict[str, Any]:
    return {
        "starting_time": {"nanoseconds_since_epoch": first},
        "duration": {"nanoseconds": last - first},
        "message_count": count,
    }


def _topic(topic: RecordedTopic) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.message_type.name,
            "serialization_format": topic.message_type.serialization,
            "offered_qos_profiles": topic.qos.profiles(),
            "type_description_hash": topic.message_type.hash,
        },
        "message_count": topic.count,
    }
