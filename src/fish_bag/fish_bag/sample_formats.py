# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The same messages in every format that is read: for tests and benchmarks."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from fish_bag.message_types import message_type, typestore
from fish_bag.sample_recordings import Message, write_mcap


def write_rosbag2(
    directory: Path,
    messages: Iterable[Message],
    plugin: StoragePlugin,
    mode: CompressionMode = CompressionMode.NONE,
) -> Path:
    """A rosbag2 directory as rosbags writes it."""
    writer = Writer2(directory, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    connections: dict[str, Connection] = {}
    with writer:
        for arrival_ns, topic, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=typestore())
            writer.write(
                connections[topic], arrival_ns, bytes(typestore().serialize_cdr(message, kind))
            )
    return directory


def write_rosbag1(
    path: Path, messages: Iterable[Message], packed: Writer1.CompressionFormat | None = None
) -> Path:
    """A ROS 1 bag of the messages whose types ROS 1 has."""
    store = typestore(ros1=True)
    connections: dict[str, Connection] = {}
    writer = Writer1(path)
    if packed is not None:
        writer.set_compression(packed)
    with writer:
        for arrival_ns, topic, message in messages:
            kind = message.__msgtype__
            if kind not in store.types:
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = bytes(store.serialize_ros1(to_ros1(message), kind))
            writer.write(connections[topic], arrival_ns, raw)
    return path


def to_ros1(message: Any) -> Any:
    """The same message as ROS 1 has it: headers carry a sequence number."""
    if isinstance(message, list):
        return [to_ros1(item) for item in message]
    if not hasattr(message, "__msgtype__"):
        return message
    store = typestore(ros1=True)
    fields = {name: 0 for name, _ in store.fielddefs[message.__msgtype__][1] if name == "seq"}
    fields |= {k: to_ros1(v) for k, v in vars(message).items() if not k.isupper()}
    return store.types[message.__msgtype__](**fields)


def write_by_library(
    path: Path,
    messages: Iterable[Message],
    packed: CompressionType = CompressionType.NONE,
    chunk_bytes: int = 32 * 1024,
) -> Path:
    """A bare MCAP file as the mcap package writes it, with checksums."""
    channels: dict[str, int] = {}
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk_bytes, compression=packed)
        writer.start("ros2", "sample")
        for arrival_ns, topic, message in messages:
            kind = message_type(message.__msgtype__)
            if topic not in channels:
                schema = writer.register_schema(kind.name, kind.encoding, kind.definition)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            raw = bytes(typestore().serialize_cdr(message, kind.name))
            writer.add_message(channels[topic], arrival_ns, raw, arrival_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def write_sqlite_with_log(directory: Path, messages: list[Message]) -> Path:
    """A sqlite3 recording whose recorder was killed: at most half of the messages stand in the write-ahead log."""
    topics_at = {topic: i for i, (_, topic, _) in reversed(list(enumerate(messages)))}
    half = max(len(messages) // 2, *(i + 1 for i in topics_at.values()))  # with every topic
    whole = write_rosbag2(directory, messages[:half], StoragePlugin.SQLITE3)
    file = whole / f"{whole.name}.db3"
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode=WAL")
    topics = dict(connection.execute("SELECT name, id FROM topics"))
    late = [
        (topics[topic], time_ns, bytes(typestore().serialize_cdr(message, message.__msgtype__)))
        for time_ns, topic, message in messages[half:]
    ]
    connection.executemany(
        "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", late
    )
    connection.commit()
    companion = Path(f"{file}-wal")
    kept = companion.read_bytes()
    database = file.read_bytes()
    connection.close()  # takes the log into the database, which a killed recorder does not
    file.write_bytes(database)
    companion.write_bytes(kept)
    (whole / "metadata.yaml").unlink()  # which a killed recorder has not written
    return whole


MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
WRITERS: dict[str, Callable[[Path, list[Message]], Path]] = {
    "own": lambda path, messages: write_mcap(path, messages, {"robot": "test fish"}),
    "bare": lambda path, messages: write_by_library(path.with_suffix(".mcap"), messages),
    "bare zstd": lambda path, messages: write_by_library(
        path.with_suffix(".mcap"), messages, CompressionType.ZSTD
    ),
    "bare lz4": lambda path, messages: write_by_library(
        path.with_suffix(".mcap"), messages, CompressionType.LZ4
    ),
    "mcap": lambda path, messages: write_rosbag2(path, messages, MCAP),
    "mcap zstd chunks": lambda path, messages: write_rosbag2(
        path, messages, MCAP, CompressionMode.STORAGE
    ),
    "mcap zstd messages": lambda path, messages: write_rosbag2(
        path, messages, MCAP, CompressionMode.MESSAGE
    ),
    "mcap zstd file": lambda path, messages: write_rosbag2(
        path, messages, MCAP, CompressionMode.FILE
    ),
    "sqlite3": lambda path, messages: write_rosbag2(path, messages, SQLITE),
    "sqlite3 log": write_sqlite_with_log,
    "sqlite3 zstd": lambda path, messages: write_rosbag2(
        path, messages, SQLITE, CompressionMode.MESSAGE
    ),
    "ros1": lambda path, messages: write_rosbag1(path.with_suffix(".bag"), messages),
    "ros1 lz4": lambda path, messages: write_rosbag1(
        path.with_suffix(".bag"), messages, Writer1.CompressionFormat.LZ4
    ),
    "ros1 bz2": lambda path, messages: write_rosbag1(
        path.with_suffix(".bag"), messages, Writer1.CompressionFormat.BZ2
    ),
}
