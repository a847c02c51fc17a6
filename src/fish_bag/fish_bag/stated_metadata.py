# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What metadata.yaml of a rosbag2 directory says, versions 1 to 10, as far as it can be read.

A recording can be read without it. It helps to find the files, and its counts are compared with what was read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from fish_bag.message_types import ros2_type_name

FILE_NAME = "metadata.yaml"
TOP = "rosbag2_bagfile_information"
LFS_START = "version https://git-lfs"


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
