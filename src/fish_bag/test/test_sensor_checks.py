# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors that do not fit each other are errors, whatever the fault; a faultless swim has none."""

import numpy as np
import pytest

from fish_bag import message_build as build
from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.trial import NOT_MEASURED

DURATION = 12.0


def swim(
    gyro=lambda r: r,
    accel=lambda a: a,
    rudder=lambda a: a,
    encoder=lambda a, s: (a, s),
    pose=lambda p: p,
    imu_covariance=0.0,
):
    """Messages of a fish that winds through the pool at 0.2 m/s; every sensor may be changed."""
    t = np.arange(0, DURATION, 0.01)
    psi, rate = 0.8 * np.sin(0.9 * t), 0.72 * np.cos(0.9 * t)
    x, y = 0.002 * np.cumsum(np.cos(psi)), 0.002 * np.cumsum(np.sin(psi))
    speed = 40 * np.sin(9 * t)
    angle = -40 / 9 * np.cos(9 * t)
    out = []
    for i, now in enumerate(t):
        stamp = samples.ns(now)
        command = build.joints(
            stamp, ["rotor", "rudder"], [now, rudder(0.5 * rate[i])], [speed[i], np.nan]
        )
        out.append((stamp, "/fish/joint_command", command))
        a, s = encoder(angle[i], speed[i])
        out.append((stamp + 10, "/fish/joint_states", build.joints(stamp, ["rotor"], [a], [s])))
        force = np.array([0.1 * np.sin(9 * now), 0.2 * np.cos(9 * now), 9.81])
        imu = build.imu(stamp, gyro(np.array([0.01, -0.02, rate[i]])), accel(force), (0, 0, 0, 1))
        imu.angular_velocity_covariance[0] = imu_covariance
        out.append((stamp + 20, "/fish/imu/data", imu))
        if i % 3 == 0:
            seen = pose(np.array([x[i], y[i], psi[i]]))
            message = build.camera_pose(stamp, "pool", seen, (4e-6, 4e-6, 1e-4))
            out.append((stamp + 30, "/fish/camera/pose", message))
    return out


def kinds(tmp_path, messages):
    trial = read_trial(samples.write_mcap(tmp_path / "trial", messages))
    return {(p.severity, p.kind) for p in trial.problems}


def test_a_faultless_swim_has_no_problem(tmp_path):
    assert kinds(tmp_path, swim()) == set()


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ({"gyro": np.degrees}, {"gyro_unit"}),
        ({"gyro": lambda r: -r}, {"gyro_sign"}),
        ({"gyro": lambda r: r[[0, 2, 1]]}, {"gyro_axes"}),
        ({"accel": lambda a: a / 9.81}, {"accel_unit"}),
        ({"accel": lambda a: a - [0, 0, 9.81]}, {"accel_unit"}),
        ({"accel": lambda a: a * [1, 1, -1]}, {"accel_axes"}),
        ({"accel": lambda a: a[[2, 1, 0]]}, {"accel_axes"}),
        ({"rudder": np.degrees}, {"rudder_unit"}),
        ({"rudder": lambda a: -a}, {"rudder_sign"}),
        ({"encoder": lambda a, s: (a, s * 30 / np.pi)}, {"rotor_unit", "encoder_unit"}),
        ({"encoder": lambda a, s: (np.degrees(a), s)}, {"encoder_unit"}),
        ({"encoder": lambda a, s: (-a, s)}, {"encoder_sign"}),
        ({"encoder": lambda a, s: (-a, -s)}, {"rotor_sign"}),
        ({"pose": lambda p: p * [1000, 1000, 1]}, {"camera_unit"}),
        ({"pose": lambda p: p + [0, 0, np.pi]}, {"camera_heading"}),
        ({"pose": lambda p: p * [1, -1, 1]}, {"camera_axes"}),
        ({"pose": lambda p: p * [1, -1, -1]}, {"camera_axes"}),
    ],
)
def test_a_fault_is_an_error(tmp_path, fault, expected):
    found = {kind for severity, kind in kinds(tmp_path, swim(**fault)) if severity == "error"}
    assert found == expected


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"gyro": lambda r: 0 * r}, "gyro is"),
        ({"accel": lambda a: 0 * a + [0, 0, 9.81]}, "accelerometer is"),
        ({"encoder": lambda a, s: (a, 0.0)}, "rotor speed is"),
        ({"encoder": lambda a, s: (1.5, s)}, "rotor angle is"),
        ({"pose": lambda p: 0 * p + 0.3}, "pose is"),
        ({"pose": lambda p: p * [1, 1, 0]}, "heading is"),
    ],
)
def test_a_sensor_that_gives_one_value_is_named(tmp_path, fault, words):
    trial = read_trial(samples.write_mcap(tmp_path / "trial", swim(**fault)))
    assert [words in p.text for p in trial.problems if p.kind == "stuck"] == [True]


def test_a_mirrored_camera_of_a_fish_that_turns_a_little(tmp_path):
    t = np.arange(0, DURATION, 0.03)
    psi = 0.35 * np.sin(0.9 * t)
    x, y = 0.006 * np.cumsum(np.cos(psi)), 0.006 * np.cumsum(np.sin(psi))
    for sign, expected in ((1, set()), (-1, {("error", "camera_axes")})):
        messages = [
            (
                samples.ns(now),
                "/fish/camera/pose",
                build.camera_pose(samples.ns(now), "pool", p, (1e-6,) * 3),
            )
            for now, *p in zip(t, x, sign * y, psi, strict=True)
        ]
        found = kinds(tmp_path / str(sign), messages)
        assert {p for p in found if p[1] != "missing_topic"} == expected


@pytest.mark.parametrize("every", [1, 5], ids=["100 Hz", "20 Hz"])
def test_two_publishers_on_one_topic(tmp_path, every):
    messages = swim()
    commands = [m for m in messages if m[1] == "/fish/joint_command"][::every]
    for time_ns, topic, _ in commands:
        zeros = build.joints(time_ns + 3_000_000, ["rotor", "rudder"], [0, 0], [0, np.nan])
        messages.append((time_ns + 3_000_000, topic, zeros))
    found = kinds(tmp_path, sorted(messages, key=lambda m: m[0]))
    assert ("warning", "two_publishers") in found


def test_a_second_imu_on_the_topic(tmp_path):
    messages = swim()
    for time_ns, topic, _ in [m for m in messages if m[1] == "/fish/imu/data"]:
        other = build.imu(time_ns + 4_000_000, (0, 0, 0), (0, 0, 9.7), (0, 0, 0, 1))
        messages.append((time_ns + 4_000_000, topic, other))
    found = kinds(tmp_path, sorted(messages, key=lambda m: m[0]))
    assert ("warning", "two_publishers") in found


def test_a_gyro_that_is_not_measured_is_used_nowhere(tmp_path):
    trial = read_trial(samples.write_mcap(tmp_path / "trial", swim(imu_covariance=-1.0)))
    assert [(p.severity, p.kind) for p in trial.problems] == [("warning", "not_measured")]
    assert np.isnan(trial.imu.gyro).all()
    assert np.isfinite(trial.imu.accel).all()
    assert (trial.imu.flags == NOT_MEASURED).all()
    assert trial.clean().imu is None


@pytest.mark.parametrize("place", [0, 7, 35], ids=["x", "y", "yaw"])
def test_a_pose_of_which_a_part_is_not_measured_is_used_nowhere(tmp_path, place):
    messages = swim()
    poses = [message for _, topic, message in messages if topic == "/fish/camera/pose"]
    for message in poses[:5]:
        message.pose.covariance[place] = -1.0
    trial = read_trial(samples.write_mcap(tmp_path / "trial", messages))
    assert [(p.severity, p.kind, p.count) for p in trial.problems] == [
        ("warning", "not_measured", 5)
    ]
    assert np.isnan(trial.camera.psi[:5]).all()
    assert len(trial.clean().camera) == len(poses) - 5
