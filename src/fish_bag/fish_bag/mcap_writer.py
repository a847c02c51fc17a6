# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A rosbag2 recording in MCAP that survives a kill: what is older than `chunk_s` is on disk.

The mcap package writes the records, in chunks of 32 KiB without compression, to a `RecordFile`. That file passes every
record to the operating system at once, so that a killed process loses the open chunk only. When the disk is full the file
keeps its whole records and ends without a summary; a reserve file keeps room for that end.
Source: MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

import yaml
from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from fish_bag.bag_metadata import Qos, metadata_text, write_metadata
from fish_bag.message_types import MessageType, message_type
from fish_bag.problem import RecordingError
from fish_bag.storage import ROSBAG2_NAME

RESERVE_BYTES = 128 * 1024  # given back when the disk is full, to end the file with
RESERVE_NAME = ".reserve"
CHUNK_BYTES = 32 * 1024  # a killed process loses at most one chunk
PACKED_CHUNK_BYTES = 1024 * 1024
LIBRARY = "fish_bag"
CUSTOM_NAME = "fish_bag"  # metadata record of the custom data, for files without metadata.yaml


class DiskFullError(RecordingError):
    """Nothing more can be written; what was written before is kept."""


class RecordFile:
    """An output stream of the mcap package without a buffer: a killed process loses nothing that was written."""

    def __init__(self, path: Path) -> None:
        """Create the file, which must not exist yet, and a reserve file in the same folder.

        Raises:
            DiskFullError: there is no room for either.
        """
        self.path, self.size = path, 0
        self._reserve = path.parent / RESERVE_NAME
        try:
            self._reserve.write_bytes(bytes(RESERVE_BYTES))
            self._raw = path.open("xb", buffering=0)
        except OSError as error:
            self.release_reserve()
            raise DiskFullError(f"{path}: no room for a recording: {error.strerror}") from error

    def write(self, data: bytes) -> int:
        """Append all of `data` and return its length.

        Raises:
            DiskFullError: it could not be written; the file is as it was before, if the disk lets it.
        """
        view = memoryview(data)
        try:
            while view:
                view = view[self._raw.write(view) :]
        except OSError as error:
            self.cut(self.size)
            kept = f"{self.size} bytes written before are kept"
            raise DiskFullError(f"{self.path}: writing failed: {error.strerror}; {kept}") from error
        self.size += len(data)
        return len(data)

    def cut(self, size: int) -> None:
        """Drop everything after `size` bytes, if the disk lets it."""
        with suppress(OSError):
            self._raw.truncate(size)
            self._raw.seek(size)
            self.size = size

    def tell(self) -> int:
        """Bytes written so far."""
        return self.size

    def flush(self) -> None:
        """Do nothing: every write goes to the operating system at once."""

    def release_reserve(self) -> None:
        """Give the reserve's room back to the disk."""
        self._reserve.unlink(missing_ok=True)

    def close(self) -> None:
        """Wait until everything has reached the disk."""
        self.release_reserve()
        os.fsync(self._raw.fileno())
        self._raw.close()


@dataclass
class Topic:
    """One topic of a recording."""

    name: str
    channel_id: int
    message_type: MessageType
    qos: Qos
    count: int = 0


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
            compress: chunks of 1 MiB packed with zstandard; takes time and loses more by a kill.
        """
        if directory.exists():
            raise RecordingError(f"{directory}: exists already; recordings are never overwritten")
        directory.mkdir(parents=True)
        self.directory, self.custom = directory, custom or {}
        self.path = directory / f"{directory.name}.mcap"
        self.topics: dict[tuple[str, MessageType], Topic] = {}
        self._schema_ids: dict[MessageType, int] = {}
        self._chunk_ns = int(chunk_s * 1e9)
        self._open_since: int | None = None  # time of the open chunk's first message
        self._open: Counter[int] = Counter()  # channel -> messages of the open chunk
        self._range: tuple[int, int] | None = None
        self._closed = False
        self._file = RecordFile(self.path)
        self._writer = Writer(
            cast(IO[Any], self._file),
            chunk_size=PACKED_CHUNK_BYTES if compress else CHUNK_BYTES,
            compression=CompressionType.ZSTD if compress else CompressionType.NONE,
        )
        with self._closing_when_full():
            self._writer.start("ros2", LIBRARY)
            self._writer.add_metadata(CUSTOM_NAME, self.custom)

    def __enter__(self) -> McapRecording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def message_count(self) -> int:
        """Messages taken so far, those of the open chunk included."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def closed(self) -> bool:
        """Whether nothing more is taken."""
        return self._closed

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
            DiskFullError: the open chunk could not be written; the recording has been closed.
        """
        kind = message_type(msgtype) if isinstance(msgtype, str) else msgtype
        if (name, kind) in self.topics:
            return self.topics[name, kind]
        qos = qos or Qos()
        profiles = yaml.safe_dump(qos.profiles(), sort_keys=False)
        before = self._file.size
        with self._closing_when_full():
            if kind not in self._schema_ids:
                self._schema_ids[kind] = self._writer.register_schema(
                    kind.name, kind.encoding, kind.definition
                )
            channel = self._writer.register_channel(
                name,
                kind.serialization,
                self._schema_ids[kind],
                {"offered_qos_profiles": profiles, "topic_type_hash": kind.hash},
            )
        if self._file.size != before:
            self._chunk_is_written()
        topic = self.topics[name, kind] = Topic(name, channel, kind, qos)
        return topic

    def write(self, topic: Topic, time_ns: int, data: bytes) -> None:
        """Add one message that arrived at time_ns.

        Raises:
            DiskFullError: the chunk could not be written; the recording has been closed.
        """
        topic.count += 1
        self._open[topic.channel_id] += 1
        if self._open_since is None:
            self._open_since = time_ns
        before = self._file.size
        with self._closing_when_full():
            self._writer.add_message(
                topic.channel_id, time_ns, data, time_ns, (topic.count - 1) & 0xFFFFFFFF
            )
        first, last = self._range or (time_ns, time_ns)
        self._range = min(first, time_ns), max(last, time_ns)
        if self._file.size != before:
            self._chunk_is_written()
        else:
            self.flush_old(time_ns)

    def flush_old(self, now_ns: int) -> None:
        """Write the open chunk if its first message is older than chunk_s, or later than now: the clock was set back."""
        since = self._open_since
        if since is not None and not 0 <= now_ns - since < self._chunk_ns:
            self.flush()

    def flush(self) -> None:
        """Write the open chunk and its index."""
        with self._closing_when_full():
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_is_written()

    def close(self) -> None:
        """Write the open chunk, the summary and metadata.yaml. A second call does nothing."""
        if self._closed:
            return
        with self._closing_when_full():
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._chunk_is_written()
        end = self._file.size
        with self._closing_when_full(end):
            self._writer.add_metadata(ROSBAG2_NAME, {"serialized_metadata": self._metadata()})
            self._writer.finish()  # type: ignore[no-untyped-call]
        self._finish()

    def _chunk_is_written(self) -> None:
        self._open.clear()
        self._open_since = None

    @contextmanager
    def _closing_when_full(self, end: int | None = None) -> Iterator[None]:
        """On a full disk end the recording after `end` bytes, or without the open chunk, and raise."""
        try:
            yield
        except DiskFullError:
            self._close_full(end)
            raise

    def _close_full(self, end: int | None) -> None:
        """End the file on a full disk without a summary; the reserve has room for that end."""
        for topic in self.topics.values():
            topic.count -= self._open.pop(topic.channel_id, 0)
        self._file.release_reserve()
        if end is not None:
            self._file.cut(end)
        builder = RecordBuilder()
        DataEnd(0).write(builder)
        Footer(0, 0, 0).write(builder)
        with suppress(DiskFullError):
            self._file.write(bytes(builder.end()) + MCAP0_MAGIC)  # type: ignore[no-untyped-call]
        with suppress(OSError):  # the file is whole without metadata.yaml
            self._finish()

    def _finish(self) -> None:
        self._closed = True
        self._file.close()
        write_metadata(self.directory, self._metadata())

    def _metadata(self) -> str:
        """The text of metadata.yaml, which the file holds too."""
        topics = list(self.topics.values())
        return metadata_text(self.path.name, topics, self._range, self.custom)
