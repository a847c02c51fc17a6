# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Readings as recordings on disk, in the project's format; many messages of one kind are serialised at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_bag import message_build as build
from fish_bag.layout import find_layout
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import typestore
from fish_study.swim import Readings, kept_trials
from fish_study.trials import PERIOD

Array = NDArray[np.float64]

START_NS = 1_750_000_000_000_000_000  # a made-up day: the scenarios have none
SPACING_NS = 60_000_000_000  # between the starts of trials
GRAVITY = 9.81  # m/s^2
LATENCY = {
    "joint_command": 0.0,
    "joint_states": 0.001,
    "imu/data": 0.002,
    "camera/pose": 0.05,
}  # s, until arrival
Batch = tuple[str, Array, list[bytes]]  # topic, stamps [s], raw messages


def write_data_set(folder: Path, readings: Sequence[Readings], encoder: bool = True) -> None:
    """One recording directory for each of `kept_trials`."""
    for name, trial in kept_trials(readings).items():
        number = int(name.removeprefix("trial_"))
        write_trial(folder / name, trial, 0, START_NS + number * SPACING_NS, encoder)


def write_trial(directory: Path, r: Readings, m: int, start_ns: int, encoder: bool) -> None:
    """Trial m of readings."""
    batches = [_commands(r, m, start_ns), _imu(r, m, start_ns), _poses(r, m, start_ns)]
    if encoder:
        batches.append(_encoder(r, m, start_ns))
    write_batches(
        directory,
        [
            (topic, (start_ns + np.round(1e9 * (t + LATENCY[topic]))).astype(np.int64), raw)
            for topic, t, raw in batches
        ],
    )


def write_batches(
    directory: Path, batches: Sequence[tuple[str, NDArray[np.int64], list[bytes]]]
) -> None:
    """One recording of raw messages, in order of arrival: topic of LATENCY, arrivals [ns since epoch], messages."""
    order = np.argsort(np.concatenate([a for _, a, _ in batches]), kind="stable")
    which = np.repeat(np.arange(len(batches)), [len(a) for _, a, _ in batches])[order]
    place = np.concatenate([np.arange(len(a)) for _, a, _ in batches])[order]
    types = {"joint_command": "JointState", "joint_states": "JointState", "imu/data": "Imu"}
    with McapRecording(directory, {"robot": "fish"}, chunk_s=5.0, compress=True) as recording:
        topics = [
            recording.add_topic(
                f"/fish/{name}",
                f"sensor_msgs/msg/{types[name]}"
                if name in types
                else "geometry_msgs/msg/PoseWithCovarianceStamped",
            )
            for name, _, _ in batches
        ]
        for b, i in zip(which.tolist(), place.tolist(), strict=True):
            recording.write(topics[b], int(batches[b][1][i]), batches[b][2][i])


def serialise(
    template: Any, stamps_ns: NDArray[np.int64], columns: dict[str, Array]
) -> list[bytes]:
    """Messages like `template` with these stamps and other numbers: path -> (N,) or, for arrays, (N, count)."""
    raw = bytes(typestore().serialize_cdr(template, template.__msgtype__))
    layout = find_layout(raw, template.__msgtype__, typestore().fielddefs, False)
    rows = np.repeat(np.frombuffer(raw, np.uint8)[None], len(stamps_ns), axis=0)
    values = {
        "header.stamp.sec": stamps_ns // 10**9,
        "header.stamp.nanosec": stamps_ns % 10**9,
        **columns,
    }
    for column in layout.columns:
        if column.path in values:
            own = np.ascontiguousarray(values[column.path], dtype=column.dtype).reshape(
                len(rows), -1
            )
            rows[:, column.offset : column.offset + column.nbytes] = own.view(np.uint8)
    return [row.tobytes() for row in rows]


def _grid(r: Readings, start_ns: int) -> tuple[Array, NDArray[np.int64]]:
    t: Array = PERIOD * np.arange(len(r.commands), dtype=float)
    return t, start_ns + np.round(1e9 * t).astype(np.int64)


def _commands(r: Readings, m: int, start_ns: int) -> Batch:
    t, stamps = _grid(r, start_ns)
    template = build.joints(0, ["rotor", "rudder"], [0.0, 0.0], [0.0, np.nan])
    position = np.column_stack([r.phase[:, m], r.commands[:, m, 1]])
    velocity = np.column_stack([r.commands[:, m, 0], np.full(len(t), np.nan)])
    return (
        "joint_command",
        t,
        serialise(template, stamps, {"position": position, "velocity": velocity}),
    )


def _encoder(r: Readings, m: int, start_ns: int) -> Batch:
    t, stamps = _grid(r, start_ns)
    speed = r.encoder[:, m]
    angle = PERIOD * np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    columns = {"position": angle[:, None], "velocity": speed[:, None]}
    return "joint_states", t, serialise(build.joints(0, ["rotor"], [0.0], [0.0]), stamps, columns)


def _imu(r: Readings, m: int, start_ns: int) -> Batch:
    t, stamps = _grid(r, start_ns)
    yaw = PERIOD * np.cumsum(r.gyro[:, m])  # a game rotation vector: drifts, unknown start
    columns = {
        "angular_velocity.z": r.gyro[:, m],
        "linear_acceleration.x": r.accel[:, m, 0],
        "linear_acceleration.y": r.accel[:, m, 1],
        "orientation.z": np.sin(0.5 * yaw),
        "orientation.w": np.cos(0.5 * yaw),
    }
    template = build.imu(0, (0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0, 1.0))
    return "imu/data", t, serialise(template, stamps, columns)


def _poses(r: Readings, m: int, start_ns: int) -> Batch:
    t, pose = r.stamps[m], r.poses[m]
    stamps = start_ns + np.round(1e9 * t).astype(np.int64)
    columns = {
        "pose.pose.position.x": pose[:, 0],
        "pose.pose.position.y": pose[:, 1],
        "pose.pose.orientation.z": np.sin(0.5 * pose[:, 2]),
        "pose.pose.orientation.w": np.cos(0.5 * pose[:, 2]),
    }
    template = build.camera_pose(0, "pool", (0.0, 0.0, 0.0), (4e-6, 4e-6, 1.44e-4))
    return "camera/pose", t, serialise(template, stamps, columns)
