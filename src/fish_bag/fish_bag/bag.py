# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of one recording, whatever its format: bytes and arrival times of every topic."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np

from fish_bag.bag_metadata import parse_metadata
from fish_bag.mcap_scan import scan_mcap
from fish_bag.problem import RecordingError
from fish_bag.recording_files import RecordingFiles, bare_name, file_kind, find_files
from fish_bag.ros1_scan import scan_ros1
from fish_bag.sqlite_scan import companions, scan_sqlite
from fish_bag.storage import (
    PACKING_DAMAGE,
    Buffer,
    Contents,
    Keep,
    StoredTopic,
    name_by_magic,
    unpack_message,
    unpack_pieces,
)

STAMP_PREFIX = 16  # bytes kept of messages nobody decodes: enough for the stamp of a header
LATEST_NS = 2**63 - 1


@dataclass
class RawTopic:
    """Messages of one topic in order of arrival."""

    stored: StoredTopic
    arrival_ns: np.ndarray  # (N,) int64
    raws: list[bytes]  # whole messages, or the first STAMP_PREFIX bytes where `whole` is False
    whole: bool

    @property
    def topic(self) -> str:
        return self.stored.name

    @property
    def type(self) -> str:
        return self.stored.type

    @property
    def ros1(self) -> bool:
        return self.stored.serialization == "ros1"


@dataclass
class RawBag:
    """Everything the reader needs of one recording."""

    path: Path
    topics: list[RawTopic]
    metadata: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what is odd about files and counts
    lost: list[str] = field(default_factory=list)  # what cannot be read

    @property
    def count(self) -> int:
        return sum(len(topic.raws) for topic in self.topics)


def is_pool_bag(bag: RawBag) -> bool:
    """Whether the bag is one of the real robot's ROS 1 bags, with message types of their own."""
    return {"/runcam_tracking", "/purepursuit_target"} <= {raw.topic for raw in bag.topics}


def read_bag(path: Path, wanted: Callable[[str, str], bool]) -> RawBag:
    """Read one recording that is whole.

    Args:
        path: rosbag2 directory, bare .mcap or .db3 file, or ROS 1 .bag file.
        wanted: (topic, type) -> whether its messages are kept whole.

    Raises:
        RecordingError: nothing there, empty, truncated or not a recording; the text says what to do.
    """
    bag = salvage_bag(path, wanted)
    if bag.lost:
        said = "; ".join(bag.lost)
        advice = f"'robofish recover {path}' saves what is left" if bag.count else "nothing is left"
        raise RecordingError(f"{path}: truncated or damaged ({said}); {advice}")
    if not bag.count:
        raise RecordingError(
            f"{path}: the recording holds no messages; was anything published while it ran?"
        )
    return bag


def salvage_bag(path: Path, wanted: Callable[[str, str], bool] = lambda *_: True) -> RawBag:
    """Read what can be read of one recording; arguments and errors as those of `read_bag`."""

    def keep(topic: StoredTopic) -> int | None:
        return None if wanted(topic.name, topic.type) else STAMP_PREFIX

    try:
        found = find_files(path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    contents = []
    for file in found.files:
        part = _scan_file(file, keep)
        for said in (part.lost, part.notes):
            said[:] = [f"{file.name}: {text}" for text in said]
        contents.append(part)
    bag = _joined(path, contents, wanted)
    _complete_metadata(bag, found, contents)
    return bag


def _scan_file(path: Path, keep: Keep) -> Contents:
    """Contents of one storage file."""
    try:
        size = path.stat().st_size
        if not size and (companions(path) or companions(path.resolve())):
            return scan_sqlite(path, keep)
        if not size:
            return Contents(lost=["the file is empty (0 bytes)"])
        with path.open("rb") as file:
            data = mmap(file.fileno(), 0, access=ACCESS_READ)
        return _scan_data(path, data, keep)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error


def _scan_data(path: Path, data: Buffer, keep: Keep) -> Contents:
    kind = file_kind(path, data)
    if kind == "mcap":
        return scan_mcap(data, keep)
    if kind == "ros1":
        return scan_ros1(data, keep)
    if kind == "sqlite3":
        return scan_sqlite(path, keep)
    with tempfile.TemporaryDirectory() as folder:
        inner = Path(folder) / bare_name(path.name)
        whole, size = True, 0
        with inner.open("wb") as file:
            try:
                for piece in unpack_pieces(kind, data):
                    part, whole = piece
                    size += file.write(part)
            except PACKING_DAMAGE as error:
                return Contents(lost=[f"its compression {kind} cannot be undone ({error})"])
        contents = _scan_file(inner, keep) if size else Contents()
    if not whole:
        contents.lost.insert(0, f"the end of what {kind} packed")
    return contents


def _joined(path: Path, contents: list[Contents], wanted: Callable[[str, str], bool]) -> RawBag:
    """All channels of all files by topic, type and serialisation (two types on a topic give two entries)."""
    stored: dict[tuple[str, str, str], StoredTopic] = {}
    times: dict[tuple[str, str, str], list[int]] = {}
    raws: dict[tuple[str, str, str], list[bytes]] = {}
    for part in contents:
        for channel, topic in part.topics.items():
            key = (topic.name, topic.type, topic.serialization)
            if not stored.setdefault(key, topic).definition and topic.definition:
                stored[key] = topic
            found = part.messages.get(channel)
            times.setdefault(key, []).extend(found.times if found else ())
            raws.setdefault(key, []).extend(found.raws if found else ())
    bag = RawBag(path, [])
    for key, topic in stored.items():
        arrival_ns, out_of_range = _nanoseconds(times[key])
        if out_of_range:
            bag.notes.append(f"{topic.name}: {out_of_range} times of arrival are out of range")
        order = np.argsort(arrival_ns, kind="stable")
        if (np.diff(order) != 1).any():
            arrival_ns, raws[key] = arrival_ns[order], [raws[key][i] for i in order]
        whole = wanted(topic.name, topic.type)
        raw = RawTopic(topic, arrival_ns, raws[key], whole)
        _unpack_messages(raw, bag.lost)
        bag.topics.append(raw)
    bag.lost += [text for part in contents for text in part.lost]
    bag.notes += [text for part in contents for text in part.notes]
    return bag


def _nanoseconds(times: list[int]) -> tuple[np.ndarray, int]:
    """(N,) int64 of times, and how many do not fit into it (they are set to its limit)."""
    try:
        return np.array(times, np.int64), 0
    except OverflowError:
        fitting = [min(time, LATEST_NS) for time in times]
        return np.array(fitting, np.int64), sum(time > LATEST_NS for time in times)


def _unpack_messages(raw: RawTopic, lost: list[str]) -> None:
    """Undo the compression of single messages (rosbag2's compression mode `message`)."""
    if raw.stored.serialization not in ("cdr", "ros1") or not any(
        map(name_by_magic, raw.raws[:1] + raw.raws[-1:])
    ):
        return
    if not raw.whole:  # its beginning says nothing
        raw.raws = [b""] * len(raw.raws)
        return
    unpacked = [unpack_message(message) for message in raw.raws]
    good = [i for i, message in enumerate(unpacked) if message is not None]
    if len(good) < len(unpacked):
        lost.append(
            f"{raw.topic}: {len(unpacked) - len(good)} messages whose compression cannot be undone"
        )
    raw.arrival_ns = raw.arrival_ns[good]
    raw.raws = [message for message in unpacked if message is not None]


def _complete_metadata(bag: RawBag, found: RecordingFiles, contents: list[Contents]) -> None:
    """Custom data, notes on files, and the comparison of the stated counts with what was read."""
    for part in contents:
        if part.metadata:
            bag.metadata |= parse_metadata(part.metadata).custom
        bag.metadata |= part.custom
    bag.notes = (["; ".join(found.notes)] if found.notes else []) + bag.notes
    if found.stated is None:
        return
    bag.metadata |= found.stated.custom
    read: Counter[tuple[str, str]] = Counter()
    for raw in bag.topics:
        read[raw.topic, raw.type] += len(raw.raws)
    if found.stated.counts is not None:
        for topic in sorted(set(found.stated.counts) | set(read)):
            said, have = found.stated.counts.get(topic, 0), read[topic]
            if said != have:
                bag.notes.append(
                    f"{topic[0]}: {have} messages were read, metadata.yaml says {said}"
                )
    differs = found.stated.total not in (None, bag.count)
    if differs and found.stated.counts in (None, {k: n for k, n in read.items() if n}):
        bag.notes.append(f"{bag.count} messages were read, metadata.yaml says {found.stated.total}")
    for file, part in zip(found.files, contents, strict=True):
        said = found.stated.file_counts.get(file.name, part.count)
        repeated = len(contents) == 1 and said == found.stated.total
        if said != part.count and not repeated:
            text = f"{file.name}: {part.count} messages were read, metadata.yaml says {said}"
            bag.notes.append(text)
