"""Every message that can still be read from an MCAP file that was cut off or damaged, and what is lost.

The file is walked record by record from its start. A chunk that is cut is read as far as it goes; a chunk whose
checksum or compression is wrong is skipped. Where bytes make no sense the walk goes on at the next chunk that
the summary knows; a file without a summary (cut off) ends there. The summary, which has a checksum, also
holds all schemas and channels once more, and how many messages there should be.
Source: MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Message, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from fish_bag.mcap_writer import CUSTOM_NAME

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
CHUNK_HEAD = struct.Struct("<QQQI")  # first time, last time, uncompressed size, checksum
CHUNK_HEAD_BYTES = 64  # with the name of the compression and the size
FOOTER_BYTES = RECORD_HEAD.size + 20
DAMAGE = (McapError, struct.error, UnicodeDecodeError)  # what parsing one damaged record raises
CHUNK_DAMAGE = (*DAMAGE, zstandard.ZstdError, RuntimeError, MemoryError)  # and unpacking one


@dataclass
class Summary:
    """The summary section of a file that was closed."""

    start: int  # byte
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)  # bytes at which they start
    messages: int | None = None  # in the whole file; None: not said


@dataclass
class Walk:
    """What was found in one file."""

    path: Path
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)
    custom: dict[str, str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)  # one sentence per loss

    def lose(self, what: str) -> None:
        self.lost.append(f"{self.path.name}: {what}")


@dataclass(frozen=True)
class Record:
    """One record as it lies in the file or in a chunk."""

    opcode: int
    body: bytes
    position: int  # of its first byte
    cut: bool  # by the end of the data

    def read(self, kind: type[Readable]) -> Any:
        """The record's fields; one of DAMAGE if they make no sense."""
        return kind.read(ReadDataStream(BytesIO(self.body)))


class Readable(Protocol):
    """A record class of the mcap package."""

    @staticmethod
    def read(stream: ReadDataStream) -> Any: ...


def walk_file(path: Path) -> Walk:
    """Collect every message that can still be read from one file."""
    data = path.read_bytes()
    walk = Walk(path)
    if not data.startswith(MCAP0_MAGIC):
        walk.lose(f"{len(data)} bytes that do not start like an MCAP file")
        return walk
    summary = read_summary(data)
    _walk_data(walk, data, summary)
    if summary is not None:  # its checksum holds, the data's definitions have none
        walk.schemas |= summary.schemas
        walk.channels |= summary.channels
    _drop_undefined(walk)
    if summary is not None and not walk.lost and len(walk.messages) < (summary.messages or 0):
        missing = (summary.messages or 0) - len(walk.messages)
        walk.lose(
            f"{missing} of the {summary.messages} messages that its statistics count are not in it"
        )
    return walk


def read_summary(data: bytes) -> Summary | None:
    """The summary section; None where there is none or where it is damaged."""
    footer_at = len(data) - len(MCAP0_MAGIC) - FOOTER_BYTES
    if footer_at < 0 or not data.endswith(MCAP0_MAGIC):
        return None
    ending = next(_records(data, footer_at, len(data)))
    if ending.opcode != Opcode.FOOTER or ending.cut:
        return None
    footer = ending.read(Footer)
    start, covered = (
        footer.summary_start,
        footer_at + FOOTER_BYTES - 4,
    )  # the checksum itself is not covered
    if not 0 < start <= footer_at or (
        footer.summary_crc and zlib.crc32(data[start:covered]) != footer.summary_crc
    ):
        return None
    summary = Summary(start)
    try:
        for record in _records(data, start, footer_at):
            _take_summary(summary, record)
    except DAMAGE:
        return None  # only where the writer left out the checksum
    summary.chunks.sort()
    return summary


def _take_summary(summary: Summary, record: Record) -> None:
    if record.opcode == Opcode.SCHEMA:
        schema = record.read(Schema)
        summary.schemas[schema.id] = schema
    elif record.opcode == Opcode.CHANNEL:
        channel = record.read(Channel)
        summary.channels[channel.id] = channel
    elif record.opcode == Opcode.CHUNK_INDEX:
        summary.chunks.append(record.read(ChunkIndex).chunk_start_offset)
    elif record.opcode == Opcode.STATISTICS:
        summary.messages = record.read(Statistics).message_count


def _walk_data(walk: Walk, data: bytes, summary: Summary | None) -> None:
    """All records before the summary, from the start or, after nonsense, from the next chunk."""
    chunks, end = (summary.chunks, summary.start) if summary else ([], len(data))
    start: int | None = len(MCAP0_MAGIC)
    while start is not None:
        begun, start = start, None
        for record in _records(data, begun, end):
            if record.opcode == Opcode.DATA_END and not record.cut:
                if summary is None:
                    walk.lose("no message, but its index is cut off or damaged")
                return
            following = bisect_right(chunks, record.position)
            if record.cut and following < len(chunks):
                start = chunks[following]
                walk.lose(
                    f"{start - record.position} bytes from byte {record.position} on make no sense"
                )
                break
            _take(walk, record)
    if summary is None and not walk.lost:
        walk.lose("no whole message, but the file ends before its index")


def _records(data: bytes, start: int, end: int) -> Iterator[Record]:
    """The records between two bytes; the last one may be cut."""
    position = start
    while position < end:
        if position + RECORD_HEAD.size > end:
            yield Record(0, data[position:end], position, cut=True)
            return
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        body_at = position + RECORD_HEAD.size
        yield Record(
            opcode, data[body_at : min(body_at + length, end)], position, cut=body_at + length > end
        )
        position = body_at + length


def _take(walk: Walk, record: Record) -> None:
    """One record into the walk; damage becomes a line of `lost`."""
    if record.opcode == Opcode.CHUNK:
        _take_chunk(walk, record)
    elif record.cut:
        walk.lose(f"{len(record.body)} bytes of a record cut at byte {record.position}")
    else:
        try:
            _take_whole(walk, record)
        except DAMAGE as error:
            walk.lose(
                f"the record at byte {record.position} cannot be read ({error or type(error).__name__})"
            )


def _take_whole(walk: Walk, record: Record) -> None:
    if record.opcode == Opcode.SCHEMA:
        schema = record.read(Schema)
        walk.schemas[schema.id] = schema
    elif record.opcode == Opcode.CHANNEL:
        channel = record.read(Channel)
        walk.channels[channel.id] = channel
    elif record.opcode == Opcode.MESSAGE:
        walk.messages.append(Message.read(ReadDataStream(BytesIO(record.body)), len(record.body)))
    elif record.opcode == Opcode.METADATA:
        metadata = record.read(Metadata)
        if metadata.name == CUSTOM_NAME:
            walk.custom.update(metadata.metadata)


def _take_chunk(walk: Walk, chunk: Record) -> None:
    """The records in a chunk; of a cut chunk those before the cut."""
    before = len(walk.messages)
    if chunk.cut and len(chunk.body) < CHUNK_HEAD_BYTES:
        walk.lose(f"{len(chunk.body)} bytes of a chunk cut at byte {chunk.position}")
        return
    try:
        data, damaged = _decompress(chunk.body)
    except CHUNK_DAMAGE as error:
        walk.lose(
            f"chunk at byte {chunk.position} cannot be read ({error or type(error).__name__})"
        )
        return
    if damaged and not chunk.cut:
        walk.lose(f"chunk at byte {chunk.position} is damaged (wrong checksum); skipped")
        return
    for record in _records(data, 0, len(data)):
        if not record.cut:
            _take(walk, record)
    if chunk.cut:
        saved = len(walk.messages) - before
        walk.lose(
            f"the chunk at byte {chunk.position} is cut; its first {saved} messages are saved, the rest is lost"
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


def _drop_undefined(walk: Walk) -> None:
    """Without the record that says what a channel carries its messages are only bytes."""
    walk.channels = {
        k: channel for k, channel in walk.channels.items() if channel.schema_id in walk.schemas
    }
    gone = Counter(m.channel_id for m in walk.messages if m.channel_id not in walk.channels)
    for channel, count in sorted(gone.items()):
        walk.lose(f"{count} messages of channel {channel}, whose topic or type is lost")
    walk.messages = [m for m in walk.messages if m.channel_id in walk.channels]
