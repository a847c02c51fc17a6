# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small recordings of a robot whose every value is known in closed form, in every format that is read: for tests and examples."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from fish_bag import message_build as build
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import message_type, typestore

START_NS = 1_700_000_000_000_000_000
LATENCY_S = {
    "joint_command": 0.0,
    "joint_states": 0.001,
    "imu/data": 0.002,
    "camera/pose": 0.025,
    "camera/tail": 0.025,
}
Numbers = Any  # a number, or an array of them
Message = tuple[int, str, Any]  # arrival [ns], topic, rosbags message


def ns(t: float) -> int:
    """Time stamp [ns] of a time [s] of the recording."""
    return START_NS + round(t * 1e9)


def phase(t: Numbers) -> Numbers:
    """Rotor's phase [rad] at times t [s]."""
    return 2 * np.pi * 1.5 * np.asarray(t)


def rotor_speed(t: Numbers) -> Numbers:
    """Rotor's speed [rad/s] at times t [s]."""
    return -40.0 * np.sin(phase(t))


def rudder(t: Numbers) -> Numbers:
    """Rudder's angle [rad] at times t [s]."""
    return 0.3 * np.sin(0.9 * np.asarray(t))


def pose(t: Numbers) -> Numbers:
    """Pose (..., 3) [m, m, rad] at times t [s]: a slow ellipse, heading along it."""
    a = 0.4 * np.asarray(t)
    return np.stack([np.cos(a), 0.6 * np.sin(a), np.arctan2(0.6 * np.cos(a), -np.sin(a))], axis=-1)


def robot_messages(duration: float = 2.0, namespace: str = "/fish") -> list[Message]:
    """Every topic of a robot, in order of arrival."""
    out: list[Message] = []

    def add(topic: str, t: float, message: Any) -> None:
        out.append((ns(t + LATENCY_S.get(topic, 0.003)), f"{namespace}/{topic}", message))

    for t in np.arange(0, duration, 0.01):
        command = [phase(t), rudder(t)], [rotor_speed(t), np.nan]
        add("joint_command", t, build.joints(ns(t), ["rotor", "rudder"], *command))
        add("joint_states", t, build.joints(ns(t), ["rotor"], [0.5 * t], [rotor_speed(t) - 0.5]))
        add("imu/data", t, build.imu(ns(t), (0.1, 0.2, t), (1.0, t, 9.81), (0.0, 0.0, 0.6, 0.8)))
        add("odometry/filtered", t, build.odometry(ns(t), pose(t), (0.2, 0.01 * t, 0.4)))
    for t in np.arange(0.005, duration, 1 / 30):
        add("camera/pose", t, build.camera_pose(ns(t), "pool", pose(t), (4e-6, 4e-6, 1.44e-4)))
        add("camera/tail", t, build.joints(ns(t), ["tail_1", "tail_2"], [0.1 * t, -0.2 * t]))
    for t in np.arange(0, duration, 0.02):
        add("control/gains", t, build.labelled_numbers("p,i,d,p2,i2,d2", [1, 2, 3, 4, 5, t]))
        add("control/target", t, build.pose_stamped(ns(t), "pool", 1.0, t, 0.5))
        add("tracking/error", t, build.vector_stamped(ns(t), "base_link", (0.01, 0.02, 0.03)))
    for t in np.arange(0, duration, 1.0):
        add("battery_state", t, build.battery(ns(t), 12.0 - 0.1 * t))
    add("reference/speed", 0.1, build.number(0.2))
    add(
        "reference/path",
        0.0,
        build.path(ns(0), "pool", np.array([[0.0, 0.0], [1.0, 0.5], [1.5, 0.5]])),
    )
    return sorted(out, key=lambda m: m[0])


def write_mcap(
    directory: Path, messages: Iterable[Message], custom: dict[str, str] | None = None
) -> Path:
    """A recording directory of these messages, in this order."""
    with McapRecording(directory, custom) as recording:
        for arrival_ns, topic, message in messages:
            raw = bytes(typestore().serialize_cdr(message, message.__msgtype__))
            recording.write(recording.add_topic(topic, message.__msgtype__), arrival_ns, raw)
    return directory


def robot_recording(directory: Path, **options: Any) -> Path:
    """A complete, faultless recording; options as those of `robot_messages`."""
    return write_mcap(directory, robot_messages(**options))


def changed(
    messages: Iterable[Message],
    topic: str,
    change: Callable[[int, int, Any], tuple[int, Any] | None],
) -> list[Message]:
    """Messages with `change(i, arrival_ns, message)` applied to one topic (None drops the message)."""
    out, i = [], 0
    for arrival_ns, name, message in messages:
        if name != topic:
            out.append((arrival_ns, name, message))
            continue
        result = change(i, arrival_ns, message)
        i += 1
        if result is not None:
            out.append((result[0], name, result[1]))
    return out


def shift_stamp(message: Any, seconds: float) -> Any:
    """Move the header stamp in place."""
    stamp = message.header.stamp
    total = stamp.sec * 10**9 + stamp.nanosec + round(seconds * 1e9)
    message.header = build.header(total, message.header.frame_id)
    return message


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
