# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml of a rosbag2 directory, and quality of service as it stands there.

It is written in version 9, as ROS 2 Jazzy does. Versions 1 to 10 are read, as far as they can be. A recording can be read
without it. It helps to find the files, and its counts are compared with what was read.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

import yaml

from fish_bag.message_types import MessageType, ros2_type_name

LARGEST_DEPTH = 100_000  # messages; damaged texts may hold any number
FILE_NAME = "metadata.yaml"
TOP = "rosbag2_bagfile_information"
LFS_START = "version https://git-lfs"


@dataclass(frozen=True)
class Qos:
    """Policies of one publisher; the others keep their defaults."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10

    def profiles(self) -> list[dict[str, Any]]:
        """As `offered_qos_profiles` of rosbag2 (metadata version 9): a list of one profile."""
        unset = {"sec": 0, "nsec": 0}
        return [
            {
                "history": "keep_last",
                "depth": self.depth,
                "reliability": "reliable" if self.reliable else "best_effort",
                "durability": "transient_local" if self.transient_local else "volatile",
                "deadline": dict(unset),
                "lifespan": dict(unset),
                "liveliness": "automatic",
                "liveliness_lease_duration": dict(unset),
                "avoid_ros_namespace_conventions": False,
            }
        ]


def parse_qos(text: str) -> Qos:
    """What the publishers offered, from `offered_qos_profiles` as YAML; the usual policies where nothing is said.

    Policies stand by name (metadata version 9 on) or by number (before).
    """
    try:
        profiles = yaml.safe_load(text) if text else []
    except (yaml.YAMLError, ValueError, RecursionError):
        profiles = []
    given = [p for p in profiles if isinstance(p, dict)] if isinstance(profiles, list) else []
    if not given:
        return Qos()
    depth = given[0].get("depth")
    return Qos(
        reliable=all(p.get("reliability") not in ("best_effort", 2) for p in given),
        transient_local=all(p.get("durability") in ("transient_local", 1) for p in given),
        depth=depth if isinstance(depth, int) and 1 <= depth <= LARGEST_DEPTH else Qos().depth,
    )


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


@dataclass
class StatedMetadata:
    """What it says; `notes` has what is wrong with it."""

    files: tuple[str, ...] = ()  # names of the storage files
    counts: dict[tuple[str, str], int] | None = None  # (topic, type) -> messages; None: not said
    file_counts: dict[str, int] = field(default_factory=dict)  # name of a storage file -> messages
    total: int | None = None  # messages of the whole recording; None: not said
    custom: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def read_metadata(folder: Path) -> StatedMetadata | None:
    """Read `folder`/metadata.yaml; None where there is none."""
    path = folder / FILE_NAME
    if not path.exists():
        return None
    try:
        text = path.read_bytes().decode(errors="replace")
    except OSError as error:
        return StatedMetadata(notes=[f"{FILE_NAME} cannot be read: {error.strerror or error}"])
    return parse_metadata(text)


def parse_metadata(text: str) -> StatedMetadata:
    """Read the text of a metadata.yaml."""
    if text.startswith(LFS_START):
        return StatedMetadata(notes=[f"{FILE_NAME} is a Git LFS pointer; run 'git lfs pull'"])
    if not text.strip("\0 \t\r\n"):
        return StatedMetadata(notes=[f"{FILE_NAME} is empty"])
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        said = " ".join(str(error).split())
        return StatedMetadata(notes=[f"{FILE_NAME} is not YAML: {said}"])
    given = document.get(TOP) if isinstance(document, dict) else None
    if not isinstance(given, dict):
        return StatedMetadata(notes=[f"{FILE_NAME} has no mapping {TOP}"])
    stated = StatedMetadata()
    paths = given.get("relative_file_paths")
    if isinstance(paths, list):
        stated.files = tuple(map(_name, paths))
    else:
        stated.notes.append(f"{FILE_NAME} has no list relative_file_paths")
    custom = given.get("custom_data")
    if isinstance(custom, dict):
        stated.custom = {str(key): str(value) for key, value in custom.items()}
    total = given.get("message_count")
    stated.total = total if isinstance(total, int) else None
    files = given.get("files")
    for entry in files if isinstance(files, list) else ():
        if isinstance(entry, dict) and isinstance(entry.get("message_count"), int):
            stated.file_counts[_name(entry.get("path"))] = entry["message_count"]
    topics = given.get("topics_with_message_count")
    if isinstance(topics, list):
        counts: Counter[tuple[str, str]] = Counter()
        for topic, count in _topics(topics):
            counts[topic] += count
        stated.counts = dict(counts)
    else:
        stated.notes.append(f"{FILE_NAME} has no list topics_with_message_count")
    return stated


def _name(path: Any) -> str:
    """The name of a file whose path metadata.yaml gives."""
    return PurePosixPath(str(path).replace("\\", "/")).name


def _topics(entries: list[Any]) -> Iterator[tuple[tuple[str, str], int]]:
    """(topic, type) and count of every entry that has them."""
    for entry in entries:
        about = entry.get("topic_metadata") if isinstance(entry, dict) else None
        count = entry.get("message_count") if isinstance(entry, dict) else None
        if isinstance(about, dict) and isinstance(count, int):
            yield (str(about.get("name")), ros2_type_name(str(about.get("type")))), count
