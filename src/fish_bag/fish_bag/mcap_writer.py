"""A rosbag2 recording in MCAP that survives a kill: what is older than `chunk_s` is on disk.

    magic | Header | Schema, Channel ... | Chunk, MessageIndex ... | DataEnd | summary | Footer | magic

Schemas and channels are written when a topic appears, chunks when they are full or old enough, and every
write goes to the operating system at once, so that a killed process loses the open chunk only. When the
disk is full the file is cut back to the last whole record and closed with what space is left; a reserve
file keeps a little for that.
Source: MCAP specification (mcap.dev/spec); records are those of the mcap package.
"""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from fish_bag.bag_metadata import write_metadata
from fish_bag.message_types import MessageType, message_type
from fish_bag.problem import RecordingError
from fish_bag.qos import Qos
from fish_bag.record_file import DiskFullError, RecordFile

CHUNK_BYTES = 1 << 20
LIBRARY = "fish_bag"
CUSTOM_NAME = "fish_train"  # metadata record that keeps the custom data even if metadata.yaml is never written


@dataclass
class Topic:
    """One topic of a recording."""

    channel: Channel
    message_type: MessageType
    qos: Qos
    count: int = 0

    @property
    def name(self) -> str:
        return self.channel.topic


@dataclass
class _OpenChunk:
    """Messages not yet on disk."""

    records: RecordBuilder = field(default_factory=RecordBuilder)
    times: list[int] = field(default_factory=list)
    index: dict[int, list[tuple[int, int]]] = field(
        default_factory=dict
    )  # channel -> (time, offset)


class McapRecording:
    """Writes one recording directory: `<directory>/<name>.mcap` and metadata.yaml."""

    def __init__(
        self,
        directory: Path,
        custom: dict[str, str] | None = None,
        chunk_s: float = 0.5,
        compress: bool = False,
    ) -> None:
        """Create the directory, which must not exist yet.

        Args:
            custom: stored with the recording ("robot" names the robot).
            chunk_s: age at which an open chunk is written [s], by the times given to `write`.
            compress: chunks are packed with zstandard; costs time while recording.
        """
        if directory.exists():
            raise RecordingError(f"{directory}: exists already; recordings are never overwritten")
        directory.mkdir(parents=True)
        self.directory, self.custom = directory, custom or {}
        self.path = directory / f"{directory.name}.mcap"
        self.topics: dict[tuple[str, str], Topic] = {}
        self._schemas: dict[str, Schema] = {}
        self._chunk_ns = int(chunk_s * 1e9)
        self._compression = "zstd" if compress else ""
        self._chunk = _OpenChunk()
        self._chunks: list[ChunkIndex] = []
        self._range: tuple[int, int] | None = None
        self._closed = False
        self._file = RecordFile(self.path)
        start = [Header("ros2", LIBRARY), Metadata(CUSTOM_NAME, self.custom)]
        self._file.append(MCAP0_MAGIC + _records(*start))

    def __enter__(self) -> McapRecording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def message_count(self) -> int:
        """Messages taken so far, those of the open chunk included."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def size(self) -> int:
        """Bytes on disk."""
        return self._file.size

    def add_topic(self, name: str, msgtype: str | MessageType, qos: Qos | None = None) -> Topic:
        """Announce a topic; the same name and type again give the same topic.

        Args:
            msgtype: name of a common interface, or the definition of any type.

        Raises:
            RecordingError: the type is unknown.
        """
        kind = message_type(msgtype) if isinstance(msgtype, str) else msgtype
        known = self.topics.get((name, kind.name))
        if known is not None:
            return known
        schema = self._schemas.get(kind.name)
        new: list[McapRecord] = []
        if schema is None:
            data = kind.definition.encode()
            schema = Schema(
                id=len(self._schemas) + 1, name=kind.name, encoding=kind.encoding, data=data
            )
            new.append(schema)
        qos = qos or Qos()
        channel = Channel(
            id=len(self.topics) + 1,
            topic=name,
            schema_id=schema.id,
            message_encoding="cdr",
            metadata={"offered_qos_profiles": yaml.safe_dump(qos.profiles(), sort_keys=False)},
        )
        self._append_or_close(_records(*new, channel))
        self._schemas[kind.name] = schema
        topic = self.topics[name, kind.name] = Topic(channel, kind, qos)
        return topic

    def write(self, topic: Topic, time_ns: int, data: bytes) -> None:
        """Add one message that arrived at time_ns.

        Raises:
            DiskFullError: the chunk could not be written; the recording has been closed.
        """
        chunk, channel = self._chunk, topic.channel.id
        chunk.index.setdefault(channel, []).append((time_ns, chunk.records.count))
        chunk.times.append(time_ns)
        Message(channel, time_ns, data, time_ns, topic.count & 0xFFFFFFFF).write(chunk.records)
        topic.count += 1
        if chunk.records.count >= CHUNK_BYTES or time_ns - chunk.times[0] >= self._chunk_ns:
            self.flush()

    def flush_old(self, now_ns: int) -> None:
        """Write the open chunk if its first message is older than chunk_s (for quiet topics)."""
        if self._chunk.times and now_ns - self._chunk.times[0] >= self._chunk_ns:
            self.flush()

    def flush(self) -> None:
        """Write the open chunk and its index."""
        if not self._chunk.times:
            return
        chunk, self._chunk = self._chunk, _OpenChunk()
        first, last, data = min(chunk.times), max(chunk.times), chunk.records.end()  # type: ignore[no-untyped-call]
        packed = zstandard.compress(data) if self._compression else data
        body = _records(
            Chunk(
                compression=self._compression,
                data=packed,
                uncompressed_size=len(data),
                uncompressed_crc=zlib.crc32(data),
                message_start_time=first,
                message_end_time=last,
            )
        )
        offsets, index = {}, b""
        for channel, entries in chunk.index.items():
            offsets[channel] = self._file.size + len(body) + len(index)
            index += _records(MessageIndex(channel_id=channel, records=entries))
        entry = ChunkIndex(
            chunk_start_offset=self._file.size,
            chunk_length=len(body),
            compression=self._compression,
            compressed_size=len(packed),
            uncompressed_size=len(data),
            message_index_offsets=offsets,
            message_index_length=len(index),
            message_start_time=first,
            message_end_time=last,
        )
        self._append_or_close(body + index, lost=chunk)
        self._chunks.append(entry)
        self._range = (
            (min(first, self._range[0]), max(last, self._range[1]))
            if self._range
            else (first, last)
        )

    def close(self) -> None:
        """Write the open chunk, the summary and metadata.yaml. A second call does nothing."""
        if self._closed:
            return
        self.flush()
        self._append_or_close(self._ending())
        self._finish()

    def _append_or_close(self, data: bytes, lost: _OpenChunk | None = None) -> None:
        """Write whole records; on a full disk end the recording without them and say so."""
        try:
            self._file.append(data)
        except DiskFullError:
            gone = lost.index if lost else {}
            for topic in self.topics.values():
                topic.count -= len(gone.get(topic.channel.id, []))
            self._close_full()
            raise

    def _close_full(self) -> None:
        """End the file on a full disk: with the summary if it fits into the reserve, else without."""
        self._file.release_reserve()
        bare = _records(DataEnd(0), Footer(0, 0, 0)) + MCAP0_MAGIC
        for ending in (self._ending(), bare, b""):
            with suppress(DiskFullError):
                self._file.append(ending)
                break
        with suppress(
            OSError
        ):  # without metadata.yaml the file is still read, and mended by recover
            self._finish()

    def _finish(self) -> None:
        self._closed = True
        self._file.close()
        write_metadata(
            self.directory, self.path.name, list(self.topics.values()), self._range, self.custom
        )

    def _ending(self) -> bytes:
        """DataEnd, summary section with its offsets, footer and magic."""
        end = _records(DataEnd(0))
        start = self._file.size + len(end)
        channels = [topic.channel for topic in self.topics.values()]
        first, last = self._range or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(channels),
            chunk_count=len(self._chunks),
            metadata_count=1,
            channel_message_counts={
                topic.channel.id: topic.count for topic in self.topics.values()
            },
            message_count=self.message_count,
            message_start_time=first,
            message_end_time=last,
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(channels)),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
        ]
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = _records(*records)
            if group:
                offsets += _records(
                    SummaryOffset(
                        group_opcode=opcode,
                        group_start=start + len(summary),
                        group_length=len(group),
                    )
                )
            summary += group
        return (
            end
            + summary
            + offsets
            + _footer(start, start + len(summary), summary + offsets)
            + MCAP0_MAGIC
        )


def _records(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _footer(summary_start: int, offset_start: int, summary: bytes) -> bytes:
    """Footer whose checksum covers the summary and the footer up to the checksum itself."""
    bare = _records(Footer(summary_start, offset_start, 0))
    return _records(Footer(summary_start, offset_start, zlib.crc32(summary + bare[:-4])))
