"""Mend an MCAP recording that was cut off or damaged: save every whole message, say what is lost.

A file is walked record by record from its start, without its (missing) index. A chunk that is cut is read
as far as it goes; a chunk whose checksum or compression is wrong is skipped; the walk ends where a record
runs past the end of the file or where bytes make no sense.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import lz4.frame
import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from .mcap_writer import CUSTOM_NAME, McapRecording
from .message_types import MessageType, message_type
from .problem import RecordingError
from .qos import Qos

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
CHUNK_HEAD = struct.Struct("<QQQI")  # first time, last time, uncompressed size, checksum
CHUNK_HEAD_BYTES = 64  # with the name of the compression and the size


@dataclass
class Walk:
    """What was found in one file."""

    path: Path
    size: int
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)
    custom: dict[str, str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)  # one sentence per loss


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
        path: .mcap file, or directory with .mcap files.
        out: directory to be made.

    Raises:
        RecordingError: not MCAP, or not one message is left.
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
    if not files or files[0].suffix != ".mcap":
        raise RecordingError(
            f"{path}: expected an .mcap file or a folder with one; a sqlite3 recording cut off is lost, "
            "a ROS 1 bag is mended by 'rosbag reindex'"
        )
    return files


def walk_file(path: Path) -> Walk:
    """Collect every message that can still be read from one file."""
    data = path.read_bytes()
    walk = Walk(path, len(data))
    if not data.startswith(MCAP0_MAGIC):
        walk.lost.append(f"{path.name}: {len(data)} bytes that do not start like an MCAP file")
        return walk
    in_data = True  # before the summary section, which repeats what is known
    for opcode, body, position, cut in _records(data, len(MCAP0_MAGIC)):
        in_data = in_data and opcode != Opcode.DATA_END
        if opcode == Opcode.FOOTER and not cut:
            return walk
        if in_data:
            _take(walk, opcode, body, position, cut)
    if not walk.lost:
        where = "its footer" if in_data else "its index"
        walk.lost.append(f"{path.name}: no whole message, but the file ends before {where}")
    return walk


def _records(data: bytes, start: int) -> Iterator[tuple[int, bytes, int, bool]]:
    """Opcode, body, position of every record, and whether the end of the data cuts it."""
    position = start
    while position < len(data):
        if position + RECORD_HEAD.size > len(data):
            yield 0, data[position:], position, True
            return
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        body = data[position + RECORD_HEAD.size : position + RECORD_HEAD.size + length]
        yield opcode, body, position, len(body) < length
        position += RECORD_HEAD.size + length


def _take(walk: Walk, opcode: int, body: bytes, position: int, cut: bool) -> None:
    """One record into the walk; damage becomes a line of `lost`."""
    if opcode == Opcode.CHUNK:
        _take_chunk(walk, body, position, cut)
    elif cut:
        walk.lost.append(f"{walk.path.name}: {len(body)} bytes of a record cut at byte {position}")
    elif opcode == Opcode.SCHEMA:
        schema = Schema.read(ReadDataStream(BytesIO(body)))
        walk.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(ReadDataStream(BytesIO(body)))
        walk.channels[channel.id] = channel
    elif opcode == Opcode.MESSAGE:
        message = Message.read(ReadDataStream(BytesIO(body)), len(body))
        if message.channel_id in walk.channels:
            walk.messages.append(message)
        else:
            walk.lost.append(f"{walk.path.name}: a message on a channel that was lost")
    elif opcode == Opcode.METADATA:
        metadata = Metadata.read(ReadDataStream(BytesIO(body)))
        if metadata.name == CUSTOM_NAME:
            walk.custom.update(metadata.metadata)


def _take_chunk(walk: Walk, body: bytes, position: int, cut: bool) -> None:
    """The records in a chunk; of a cut chunk those before the cut."""
    before = len(walk.messages)
    if cut and len(body) < CHUNK_HEAD_BYTES:
        walk.lost.append(f"{walk.path.name}: {len(body)} bytes of a chunk cut at byte {position}")
        return
    try:
        data, damaged = _decompress(body)
    except (struct.error, zstandard.ZstdError, RuntimeError, UnicodeDecodeError) as error:
        walk.lost.append(f"{walk.path.name}: chunk at byte {position} cannot be read ({error})")
        return
    if damaged and not cut:
        walk.lost.append(f"{walk.path.name}: chunk at byte {position} is damaged (wrong checksum); skipped")
        return
    for opcode, record, _, inner_cut in _records(data, 0):
        if not inner_cut:
            _take(walk, opcode, record, position, cut=False)
    if cut:
        saved = len(walk.messages) - before
        walk.lost.append(
            f"{walk.path.name}: the chunk at byte {position} is cut; its first {saved} messages are saved, "
            "the rest is lost"
        )


def _decompress(body: bytes) -> tuple[bytes, bool]:
    """Records of a chunk as far as they go, and whether their checksum is wrong."""
    _, _, _, checksum = CHUNK_HEAD.unpack_from(body)
    (name_length,) = struct.unpack_from("<I", body, CHUNK_HEAD.size)
    start = CHUNK_HEAD.size + 4
    compression = body[start : start + name_length].decode()
    packed = body[start + name_length + 8 :]
    if compression == "zstd":
        data = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    elif compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed)
    else:
        data = packed
    return data, bool(checksum) and zlib.crc32(data) != checksum


def _copy(walk: Walk, recording: McapRecording) -> None:
    """Write the messages of one file, with their types and quality of service."""
    topics = {}
    for channel in walk.channels.values():
        kind = _kind(walk.schemas.get(channel.schema_id))
        topics[channel.id] = recording.add_topic(channel.topic, kind, _qos(channel))
    for message in sorted(walk.messages, key=lambda m: m.log_time):
        recording.write(topics[message.channel_id], message.log_time, message.data)


def _kind(schema: Schema | None) -> MessageType:
    if schema is None:
        raise RecordingError("a channel's message type is lost: nothing can be saved without it")
    try:
        return message_type(schema.name)
    except RecordingError:
        return MessageType(schema.name, schema.data.decode(), encoding=schema.encoding)


def _qos(channel: Channel) -> Qos:
    """Reliability and durability as recorded, by name or by number (versions 9 and 8)."""
    profiles = yaml.safe_load(channel.metadata.get("offered_qos_profiles") or "[]") or []
    if not profiles:
        return Qos()
    first = profiles[0]
    return Qos(
        reliable=first.get("reliability") not in ("best_effort", 2),
        transient_local=first.get("durability") in ("transient_local", 1),
        depth=max(1, int(first.get("depth", 10))),
    )
