# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small recordings of a robot whose every value is known in closed form: for tests and examples."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from fish_bag import message_build as build
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import typestore

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
