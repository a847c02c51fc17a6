"""Mend an MCAP recording that was cut off or damaged: save every whole message, say what is lost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml
from mcap.records import Channel, Schema

from fish_bag.bag import is_recording
from fish_bag.mcap_walk import Walk, walk_file
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import MessageType, message_type
from fish_bag.problem import RecordingError
from fish_bag.qos import Qos


@dataclass(frozen=True)
class Recovery:
    """What was saved and what was lost."""

    directory: Path
    saved: dict[str, int]  # topic -> messages
    first_ns: int
    last_ns: int
    lost: tuple[str, ...]

    @property
    def count(self) -> int:
        return sum(self.saved.values())


def recover(path: Path, out: Path) -> Recovery:
    """Write what is left of a recording to a new rosbag2 directory.

    Args:
        path: .mcap file, or directory with the .mcap files of one recording.
        out: directory to be made.

    Raises:
        RecordingError: not MCAP, files of several recordings, or not one message is left.
    """
    walks = [walk_file(file) for file in _files(path)]
    if not any(walk.messages for walk in walks):
        losses = "; ".join(loss for walk in walks for loss in walk.lost) or "it holds no message"
        raise RecordingError(f"{path}: nothing to save: {losses}")
    custom = {key: value for walk in walks for key, value in walk.custom.items()}
    with McapRecording(out, custom) as recording:
        for walk in walks:
            _copy(walk, recording)
    times = [message.log_time for walk in walks for message in walk.messages]
    saved = {topic.name: topic.count for topic in recording.topics.values()}
    lost = tuple(loss for walk in walks for loss in walk.lost)
    return Recovery(out, saved, min(times), max(times), lost)


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if len(files) > 1 and not is_recording(path):
        raise RecordingError(
            f"{path}: {len(files)} recordings, each complete in one file by their names; recover one of them at a time "
            f"(the parts of one recording are {path.name}_0.mcap, {path.name}_1.mcap and so on, as rosbag2 names them)"
        )
    if not files or files[0].suffix != ".mcap":
        raise RecordingError(
            f"{path}: expected an .mcap file or a folder with one; a sqlite3 recording cut off is lost, "
            "a ROS 1 bag is mended by 'rosbag reindex'"
        )
    return files


def _copy(walk: Walk, recording: McapRecording) -> None:
    """Write the messages of one file, with their types and quality of service."""
    topics = {}
    for channel in walk.channels.values():
        kind = _kind(walk.schemas[channel.schema_id])
        topics[channel.id] = recording.add_topic(channel.topic, kind, _qos(channel))
    for message in sorted(walk.messages, key=lambda m: m.log_time):
        recording.write(topics[message.channel_id], message.log_time, message.data)


def _kind(schema: Schema) -> MessageType:
    try:
        return message_type(schema.name)
    except RecordingError:
        return MessageType(
            schema.name, schema.data.decode(errors="replace"), encoding=schema.encoding
        )


def _qos(channel: Channel) -> Qos:
    """Reliability and durability as recorded, by name or by number (versions 9 and 8); the usual ones if damaged."""
    try:
        profiles = yaml.safe_load(channel.metadata.get("offered_qos_profiles") or "[]")
    except yaml.YAMLError:
        return Qos()
    if not isinstance(profiles, list) or not profiles or not isinstance(profiles[0], dict):
        return Qos()
    first, usual = profiles[0], Qos().depth
    depth = first.get("depth", usual)
    return Qos(
        reliable=first.get("reliability") not in ("best_effort", 2),
        transient_local=first.get("durability") in ("transient_local", 1),
        depth=max(1, depth) if isinstance(depth, int) else usual,
    )
