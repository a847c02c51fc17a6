# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mend a recording that was cut off or damaged: save every whole message, say what is lost."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from rosbags.rosbag1 import Writer as BagWriter

from fish_bag.bag import RawBag, RawTopic, salvage_bag
from fish_bag.bag_metadata import parse_qos
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import MessageType, message_type
from fish_bag.playback import in_order
from fish_bag.problem import RecordingError


@dataclass(frozen=True)
class Recovery:
    """What was saved and what was lost."""

    directory: Path
    saved: dict[str, int]  # topic -> messages
    first_ns: int
    last_ns: int
    lost: tuple[str, ...]
    notes: tuple[str, ...] = ()  # what is odd about the recording's files and counts

    @property
    def count(self) -> int:
        return sum(self.saved.values())


def recover(path: Path, out: Path) -> Recovery:
    """Write what is left of a recording to a new directory.

    A ROS 1 bag becomes a ROS 1 bag in that directory, any other recording MCAP. Compression is undone.

    Args:
        path: storage file, or directory with the storage files of one recording.
        out: directory to be made.

    Raises:
        RecordingError: files of several recordings, not one message is left, `out` exists or lies in the recording.
    """
    bag = salvage_bag(path)
    topics = [raw for raw in bag.topics if raw.raws]
    if not topics:
        losses = "; ".join(bag.lost) or "it holds no message"
        raise RecordingError(f"{path}: nothing to save: {losses}")
    if path.is_dir() and out.resolve().is_relative_to(path.resolve()):
        raise RecordingError(f"{out}: lies in the recording itself; expected a folder outside it")
    if out.exists():
        raise RecordingError(f"{out}: exists already; recordings are never overwritten")
    if all(raw.ros1 for raw in topics):
        _write_ros1(topics, out)
    else:
        _write_mcap(bag, topics, out)
    saved: Counter[str] = Counter()
    for raw in topics:
        saved[raw.topic] += len(raw.raws)
    first = min(int(raw.arrival_ns[0]) for raw in topics)
    last = max(int(raw.arrival_ns[-1]) for raw in topics)
    return Recovery(out, dict(saved), first, last, tuple(bag.lost), tuple(bag.notes))


def _write_mcap(bag: RawBag, topics: list[RawTopic], out: Path) -> None:
    """Write the messages with their types and quality of service."""
    with McapRecording(out, bag.metadata) as recording:
        entries = {
            id(raw): recording.add_topic(raw.topic, _kind(raw), parse_qos(raw.stored.qos))
            for raw in topics
        }
        for topic, time_ns, message in in_order(topics):
            recording.write(entries[id(topic)], max(0, time_ns), message)


def _kind(raw: RawTopic) -> MessageType:
    """The type as recorded; as the common interfaces define it where the recording does not."""
    stored = raw.stored
    if not stored.definition and stored.serialization == "cdr":
        try:
            return message_type(stored.type)
        except RecordingError:
            pass
    return MessageType(
        stored.type, stored.definition, stored.hash, stored.encoding, stored.serialization
    )


def _write_ros1(topics: list[RawTopic], out: Path) -> None:
    """Write a bag with the same bytes."""
    out.mkdir(parents=True)
    with BagWriter(out / f"{out.name}.bag") as writer:
        connections = {
            id(raw): writer.add_connection(
                raw.topic,
                raw.type,
                msgdef=raw.stored.definition.decode(errors="replace"),
                md5sum=raw.stored.hash or "*",
            )
            for raw in topics
        }
        for topic, time_ns, message in in_order(topics):
            writer.write(connections[id(topic)], time_ns, message)
