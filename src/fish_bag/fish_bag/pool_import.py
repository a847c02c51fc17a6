# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Importer of the real robot's ROS 1 bags (own message types) into recordings in the project's format.

What the fields mean and how the robot's axes and clocks lie is said in the data's own README; here it is a
table of constants and one function per topic. Robot and recorder are brought on the recorder's clock;
nothing else is corrected: frames that the camera program lost (NaN) or took wrongly stay in, and the reader
flags them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fish_bag import message_build as build
from fish_bag.bag import RawBag, is_pool_bag, read_bag
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import typestore
from fish_bag.pool_rotor import RotorCommand, rebuild_rotor_command
from fish_bag.problem import RecordingError
from fish_bag.streams import NS_PER_S, decode_paths, topic_blocks

Message = tuple[int, str, Any]  # arrival [ns], topic, message

CENTRE = np.array(
    [1.9005, 0.8688]
)  # m, image centre in the tracker's frame, taken for the pool's centre
GRAVITY = 9.81  # m/s^2, what the sensor's gravity removal is undone with
ENCODER_AGE_S = 0.042  # s, encoder samples are older than their stamp
IMU_AGE_S = 0.014  # s, half of the polling and refresh time
# of arrival minus stamp: the camera clock's offset (single frames come early)
CAMERA_QUANTILE = 0.01
CAMERA_VARIANCE = np.array([9e-6, 9e-6, 9e-4])  # m^2, m^2, rad^2
TAIL_NAMES = ["tail_1", "tail_2"]
GAIN_FIELDS = ("yaw_Kp", "yaw_Ki", "yaw_Kd", "vel_Kp", "vel_Ki", "vel_Kd")
GAIN_LABEL = "steering_kp,steering_ki,steering_kd,speed_kp,speed_ki,speed_kd"
SOURCES = {
    "camera": "/runcam_tracking",
    "imu": "/IMU_bno08x/raw",
    "encoder": "/encoder_estimates",
    "filter": "/KF_state_estimate",
    "control": "/purepursuit_target",
}
PATH_SOURCE = "/runcam_path"
NAMESPACE = "/fish"


@dataclass(frozen=True)
class Source:
    """Fields of one ROS 1 topic, stamps already on the recorder's clock."""

    values: dict[str, np.ndarray]
    stamp_ns: np.ndarray  # (N,)
    arrival_ns: np.ndarray  # (N,)

    def __getitem__(self, field: str) -> np.ndarray:
        return self.values[field]

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True)
class ImportReport:
    """What was written and how well it fits."""

    directory: Path
    messages: int
    robot_offset_s: float  # recorder minus robot
    camera_offset_s: float
    rotor_residual: float  # median abs of encoder minus rebuilt command [rad/s]


def import_bag(path: Path, out: Path) -> ImportReport:
    """Convert one ROS 1 bag to a recording directory.

    Raises:
        RecordingError: not one of these bags, or a topic is missing.
    """
    bag = read_bag(path, lambda topic, _: topic in (*SOURCES.values(), PATH_SOURCE))
    if not (is_pool_bag(bag) and all(raw.ros1 for raw in bag.topics)):
        held = ", ".join(sorted(raw.topic for raw in bag.topics))
        raise RecordingError(f"{path}: not a recording of the paper's robot; it holds {held}")
    sources = {role: _source(bag, role, topic) for role, topic in SOURCES.items()}
    robot = min(
        int((s.arrival_ns - s.stamp_ns).min()) for role, s in sources.items() if role != "camera"
    )
    delay = sources["camera"].arrival_ns - sources["camera"].stamp_ns
    camera = int(delay.min()) + round(float(np.quantile(delay - delay.min(), CAMERA_QUANTILE)))
    shifted = {
        role: Source(s.values, s.stamp_ns + (camera if role == "camera" else robot), s.arrival_ns)
        for role, s in sources.items()
    }
    last_ns = max(int(s.arrival_ns.max()) for s in shifted.values())
    rotor, start_ns = _rotor(shifted, last_ns)
    messages = [*_commands(shifted["control"], rotor, start_ns), *_path(bag)]
    for convert in (_camera, _encoder, _battery, _imu, _filter, _control):
        messages += convert(shifted)
    with McapRecording(out, {"robot": "robot of the paper", "source": path.name}) as recording:
        for arrival_ns, topic, message in sorted(messages, key=lambda m: m[0]):
            raw = typestore().serialize_cdr(message, message.__msgtype__)
            entry = recording.add_topic(f"{NAMESPACE}/{topic}", message.__msgtype__)
            recording.write(entry, arrival_ns, bytes(raw))
    return ImportReport(out, recording.message_count, robot * 1e-9, camera * 1e-9, rotor.residual)


def _source(bag: RawBag, role: str, topic: str) -> Source:
    """Decode one topic; stamps are still the robot's."""
    raw = next((raw for raw in bag.topics if raw.topic == topic and raw.raws), None)
    if raw is None:
        raise RecordingError(
            f"{bag.path}: {topic} ({role}) is missing; nothing can be imported without it"
        )
    blocks, unreadable = topic_blocks(raw, raw.raws)
    if len(blocks) != 1 or len(unreadable):
        raise RecordingError(f"{bag.path}: {topic}: messages do not all fit {raw.type}")
    values = blocks[0].values
    stamp_ns = (
        values["header.stamp.sec"].astype(np.int64) * NS_PER_S + values["header.stamp.nanosec"]
    )
    return Source(values, stamp_ns, raw.arrival_ns)


def _ns(seconds: float) -> int:
    return round(seconds * NS_PER_S)


def _wrap(angle: np.ndarray) -> np.ndarray:
    return np.mod(angle + np.pi, 2 * np.pi) - np.pi


def _rotor(sources: dict[str, Source], last_ns: int) -> tuple[RotorCommand, int]:
    """The rebuilt rotor command, times in seconds from the returned stamp."""
    control, encoder = sources["control"], sources["encoder"]
    start_ns = int(control.stamp_ns[0])
    t_encoder = (encoder.stamp_ns - start_ns) * 1e-9 - ENCODER_AGE_S
    t_loop, first = np.unique((control.stamp_ns - start_ns) * 1e-9, return_index=True)
    command = rebuild_rotor_command(
        t_loop,
        control["A"][first].astype(float),
        control["omega"][first].astype(float),
        t_encoder,
        -encoder["encoder_vel"].astype(float),
        end=(last_ns - start_ns) * 1e-9,
    )
    return command, start_ns


def _commands(control: Source, rotor: RotorCommand, start_ns: int) -> Iterator[Message]:
    """joint_command every 10 ms: the rebuilt rotor speed, and the rudder angle of the latest loop."""
    loop = np.searchsorted((control.stamp_ns - start_ns) * 1e-9, rotor.t, side="right") - 1
    rudder = np.where(
        loop >= 0, -np.deg2rad(control["servo_angle"].astype(float)[np.maximum(loop, 0)]), 0.0
    )
    for t, phase, speed, alpha in zip(rotor.t, rotor.phase, rotor.speed, rudder, strict=True):
        stamp_ns = start_ns + _ns(t)
        yield (
            stamp_ns,
            "joint_command",
            build.joints(stamp_ns, ["rotor", "rudder"], [phase, alpha], [speed, np.nan]),
        )


def _camera(sources: dict[str, Source]) -> Iterator[Message]:
    """Head pose and relative tail angles; the tracker's angles are absolute, in degrees."""
    camera = sources["camera"]
    head, tail_1, tail_2 = (
        np.deg2rad(camera[k]) for k in ("head_angle", "tail_angle_1", "tail_angle_2")
    )
    x, y = camera["x_position"] - CENTRE[0], camera["y_position"] - CENTRE[1]
    bends = np.column_stack([_wrap(tail_1 - head), _wrap(tail_2 - tail_1)])
    for i, (stamp_ns, arrival_ns) in enumerate(_times(camera)):
        pose = build.camera_pose(stamp_ns, "pool", (x[i], y[i], head[i]), CAMERA_VARIANCE)
        yield arrival_ns, "camera/pose", pose
        yield arrival_ns, "camera/tail", build.joints(stamp_ns, TAIL_NAMES, bends[i])


def _times(source: Source) -> Iterator[tuple[int, int]]:
    return zip(source.stamp_ns.tolist(), source.arrival_ns.tolist(), strict=True)


def _encoder(sources: dict[str, Source]) -> Iterator[Message]:
    """Angle and speed with the signs of REP 103."""
    encoder = sources["encoder"]
    for i, (stamp_ns, arrival_ns) in enumerate(_times(encoder)):
        angle, speed = -encoder["encoder_pos"][i], -encoder["encoder_vel"][i]
        yield (
            arrival_ns,
            "joint_states",
            build.joints(stamp_ns - _ns(ENCODER_AGE_S), ["rotor"], [angle], [speed]),
        )


def _battery(sources: dict[str, Source]) -> Iterator[Message]:
    """Volts, amperes and temperature of the motor's controller, at most once a second."""
    encoder, latest = sources["encoder"], None
    for i, (stamp_ns, arrival_ns) in enumerate(_times(encoder)):
        if latest is None or stamp_ns - latest >= NS_PER_S:
            latest = stamp_ns
            values = encoder["voltage"][i], -encoder["current"][i], encoder["temperature"][i]
            yield arrival_ns, "battery_state", build.battery(stamp_ns, *values)


def _imu(sources: dict[str, Source]) -> Iterator[Message]:
    """New samples only, with gravity put back: specific force f = a + R(q)^T (0, 0, g).

    Polling repeats samples; one is new when its orientation differs from the one before.
    """
    imu = sources["imu"]
    gyro, accel = (
        np.column_stack([imu[f"{k}.{a}"] for a in "xyz"])
        for k in ("angular_velocity", "linear_acceleration")
    )
    q = np.column_stack([imu[f"orientation.{a}"] for a in "xyzw"])
    up = _vertical(q / np.linalg.norm(q, axis=1, keepdims=True))
    new = np.concatenate([[True], (np.diff(q, axis=0) != 0).any(axis=1)])
    for i, (stamp_ns, arrival_ns) in enumerate(_times(imu)):
        if new[i]:
            stamp_ns -= _ns(IMU_AGE_S)
            yield (
                arrival_ns,
                "imu/data",
                build.imu(stamp_ns, gyro[i], accel[i] + GRAVITY * up[i], q[i]),
            )


def _vertical(q: np.ndarray) -> np.ndarray:
    """(N, 3) the world's vertical in the body's axes, third row of R(q), for unit quaternions x, y, z, w."""
    x, y, z, w = q.T
    return np.column_stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)])


def _filter(sources: dict[str, Source]) -> Iterator[Message]:
    """The robot's own filter; it has no yaw rate, which is written as 0."""
    state = sources["filter"]
    x, y = state["x"] - CENTRE[0], state["y"] - CENTRE[1]
    for i, (stamp_ns, arrival_ns) in enumerate(_times(state)):
        uvr = state["vb_x"][i], state["vb_y"][i], 0.0
        yield (
            arrival_ns,
            "odometry/filtered",
            build.odometry(stamp_ns, (x[i], y[i], state["yaw"][i]), uvr),
        )


def _control(sources: dict[str, Source]) -> Iterator[Message]:
    """Lookahead point, errors, gains and, on change, the commanded speed."""
    control, wanted = sources["control"], None
    x, y = control["goal_x"] - CENTRE[0], control["goal_y"] - CENTRE[1]
    for i, (stamp_ns, arrival_ns) in enumerate(_times(control)):
        yield (
            arrival_ns,
            "control/target",
            build.pose_stamped(stamp_ns, "pool", x[i], y[i], control["theta_p"][i]),
        )
        gains = [control[name][i] for name in GAIN_FIELDS]
        yield arrival_ns, "control/gains", build.labelled_numbers(GAIN_LABEL, gains)
        errors = control["e_fa"][i], control["error_yaw"][i], control["error_vel"][i]
        yield arrival_ns, "tracking/error", build.vector_stamped(stamp_ns, "base_link", errors)
        if control["velocity_x_des"][i] != wanted:
            wanted = control["velocity_x_des"][i]
            yield arrival_ns, "reference/speed", build.number(wanted)


def _path(bag: RawBag) -> Iterator[Message]:
    """The reference polyline, on the pool's axes."""
    for raw in bag.topics:
        if raw.topic == PATH_SOURCE:
            paths = decode_paths(raw)
            for arrival_ns, path in zip(raw.arrival_ns.tolist(), paths, strict=True):
                if path is None:
                    raise RecordingError(
                        f"{bag.path}: {raw.topic}: messages do not all fit {raw.type}"
                    )
                yield arrival_ns, "reference/path", build.path(arrival_ns, "pool", path[0] - CENTRE)
