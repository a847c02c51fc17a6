# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of recordings: what they find, and that they find nothing in sound ones."""

from dataclasses import replace

import numpy as np
import pytest
from stroke_swim import Course, stroke_swim

from fish_bag import TopicMap, read_trial, trial
from fish_bag import message_build as build
from fish_bag import sample_recordings as samples
from fish_bag.camera_checks import find_jumps
from fish_bag.checks import check_rotor_sign
from fish_bag.sensor_checks import check_sensors
from fish_bag.trial import FROZEN, JUMP, NOT_MEASURED


def read(tmp_path, messages):
    return read_trial(samples.write_mcap(tmp_path / "trial", messages))


def problem(result, kind, topic=""):
    found = [p for p in result.problems if p.kind == kind and p.topic.endswith(topic)]
    assert len(found) == 1, f"{kind} on {topic}: {[str(p) for p in result.problems]}"
    return found[0]


def test_faultless_recording_has_no_problem(tmp_path):
    result = read(tmp_path, samples.robot_messages())
    assert result.problems == ()
    assert all(not stream.flags.any() for stream in result.streams.values())


def test_gap(tmp_path):
    messages = samples.changed(
        samples.robot_messages(),
        "/fish/imu/data",
        lambda i, t, m: None if 50 <= i < 120 else (t, m),
    )
    result = read(tmp_path, messages)
    gap = problem(result, "gap", "imu/data")
    assert gap.severity == "warning"
    assert "about 70 messages" in gap.text
    assert gap.t == pytest.approx(0.49, abs=1e-6)
    assert len(result.imu) == 130


def test_duplicates_are_kept_and_flagged(tmp_path):
    messages = samples.robot_messages()
    repeated = [m for m in messages if m[1] == "/fish/imu/data"][10:15]
    messages = sorted(
        messages + [(t + 1000, topic, m) for t, topic, m in repeated], key=lambda m: m[0]
    )
    result = read(tmp_path, messages)
    assert problem(result, "duplicate", "imu/data").count == 5
    assert len(result.imu) == 205
    assert np.count_nonzero(result.imu.flags == trial.DUPLICATE) == 5
    clean = result.clean().imu
    assert len(clean) == 200
    assert np.all(np.diff(clean.t) > 0)


def test_time_going_back(tmp_path):
    def back(i, t, m):
        return t, samples.shift_stamp(m, -0.055) if 100 <= i < 103 else m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", back))
    assert problem(result, "time_back", "imu/data").count == 3
    assert np.flatnonzero(result.imu.flags & trial.TIME_BACK).tolist() == [100, 101, 102]
    assert np.all(np.diff(result.clean().imu.t) > 0)


@pytest.mark.parametrize(
    ("by", "severity"), [(0.5037, "error"), (0.5, "error"), (0.055, "warning")]
)
def test_a_clock_that_is_set_back(tmp_path, by, severity):
    def back(i, t, m):
        return t, samples.shift_stamp(m, -by) if i >= 100 else m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", back))
    said = problem(result, "clock_back", "imu/data")
    assert said.severity == severity
    assert f"set back by {by:.3f} s at 1.00 s" in said.text


def test_single_late_messages_are_no_clock_that_is_set_back(tmp_path):
    def late(i, t, m):
        return t + 300_000_000 * (i % 20 == 5), m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/camera/pose", late))
    assert {p.kind for p in result.problems} >= {"time_back"}
    assert "clock_back" not in {p.kind for p in result.problems}


def test_a_busy_network_is_no_clock_that_is_set_back(tmp_path):
    """For a second most images arrive late, some after later ones; a few come as quickly as before."""

    def late(i, t, m):
        busy = 30 <= i < 60 and i % 5
        return t + (200_000_000 + 70_000_000 * (i % 2)) * bool(busy), m

    messages = samples.changed(samples.robot_messages(4.0), "/fish/camera/pose", late)
    result = read(tmp_path, messages)
    kinds = {p.kind for p in result.problems}
    assert "time_back" in kinds
    assert "clock_back" not in kinds


def test_arrivals_out_of_order_in_the_file(tmp_path):
    messages = samples.robot_messages()
    rng = np.random.default_rng(1)
    shuffled = [
        messages[i]
        for i in np.argsort(np.arange(len(messages)) + rng.uniform(0, 30, len(messages)))
    ]
    result = read(tmp_path, shuffled)
    np.testing.assert_allclose(result.imu.t, np.arange(0, 2, 0.01), atol=2e-9)
    assert result.problems == ()


def test_not_a_number(tmp_path):
    def broken(i, t, m):
        if i in (3, 4):
            m.angular_velocity.y = np.nan if i == 3 else np.inf
        return t, m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", broken))
    assert problem(result, "nan", "imu/data").count == 2
    assert np.flatnonzero(result.imu.flags).tolist() == [3, 4]


def test_joint_missing_from_some_messages(tmp_path):
    def without_rudder(i, t, m):
        return t, build.joints(samples.ns(i * 0.01), ["rotor"], [1.0], [2.0]) if i < 7 else m

    result = read(
        tmp_path, samples.changed(samples.robot_messages(), "/fish/joint_command", without_rudder)
    )
    assert problem(result, "nan", "joint_command").count == 7
    assert np.isnan(result.commands.rudder[:7]).all()
    assert np.isfinite(result.commands.rudder[7:]).all()
    assert result.commands.rotor_speed[0] == 2.0


def test_an_encoder_without_an_angle_measures_the_speed(tmp_path):
    def without_angle(_, t, m):
        m.position = np.zeros(0)
        return t, m

    messages = samples.changed(samples.robot_messages(), "/fish/joint_states", without_angle)
    result = read(tmp_path, messages)
    assert not result.encoder.flags.any()
    assert np.isnan(result.encoder.angle).all()
    assert np.isfinite(result.clean().encoder.speed).all()
    (said,) = result.problems
    assert (said.severity, said.kind) == ("warning", "joint")
    assert "no message has a position of joint 'rotor'" in said.text


@pytest.mark.parametrize(
    ("topic", "severity"), [("joint_command", "error"), ("joint_states", "warning")]
)
def test_joints_under_other_names_are_said(tmp_path, topic, severity):
    def renamed(_, t, m):
        m.name = [name.capitalize() for name in m.name]
        return t, m

    result = read(tmp_path, samples.changed(samples.robot_messages(), f"/fish/{topic}", renamed))
    said = [p for p in result.problems if p.kind == "joint"]
    assert {p.severity for p in said} == {severity}
    assert all("'Rotor'" in p.text for p in said)


@pytest.mark.parametrize("ahead", [7200.0, -1.6e9, 3.0])
def test_stamps_of_another_clock_move_no_other_topic(tmp_path, ahead):
    """A time zone, seconds since the start of a computer, a wrong second: the other topics keep their times."""

    def moved(_, t, m):
        return t, samples.shift_stamp(m, ahead)

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", moved))
    assert f"stamps are {ahead - 0.002:+.3f} s" in problem(result, "clock_apart", "imu/data").text
    assert result.axis == "recorder"
    np.testing.assert_allclose(result.commands.t, np.arange(0, 2, 0.01), atol=1e-6)
    np.testing.assert_allclose(result.imu.t, np.arange(0, 2, 0.01) + 0.002, atol=1e-3)


@pytest.mark.parametrize(
    ("topic", "severity"),
    [
        ("joint_command", "error"),
        ("camera/pose", "error"),
        ("imu/data", "warning"),
        ("joint_states", "info"),
    ],
)
def test_missing_topic(tmp_path, topic, severity):
    messages = [m for m in samples.robot_messages() if m[1] != f"/fish/{topic}"]
    assert problem(read(tmp_path, messages), "missing_topic", topic).severity == severity


def test_wrong_type(tmp_path):
    messages = samples.changed(
        samples.robot_messages(), "/fish/imu/data", lambda _i, t, _m: (t, build.number(1.0))
    )
    result = read(tmp_path, messages)
    assert result.imu is None
    assert (
        "std_msgs/msg/Float64, expected sensor_msgs/msg/Imu"
        in problem(result, "wrong_type", "imu/data").text
    )


@pytest.mark.parametrize("first", [0, 40])
def test_wrong_frame(tmp_path, first):
    def other(i, t, m):
        m.header = build.header(samples.ns(0.005 + i / 30), "map" if i >= first else "pool")
        return t, m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/camera/pose", other))
    text = problem(result, "wrong_frame", "camera/pose").text
    assert f"{60 - first} of 60 messages in frame 'map', expected 'pool'" in text
    assert len(result.camera) == 60
    kept = result.clean().camera
    assert (0 if kept is None else len(kept)) == first


def test_stamps_never_set(tmp_path):
    def unset(i, t, m):
        m.header = build.header(0, "imu_link")
        return t, m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", unset))
    problem(result, "no_stamps", "imu/data")
    np.testing.assert_allclose(result.imu.t, np.arange(0, 2, 0.01) + 0.002, atol=2e-9)


def test_single_stamps_far_off(tmp_path):
    def odd(i, t, m):
        return t, samples.shift_stamp(m, -1e6) if i == 20 else m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/imu/data", odd))
    assert problem(result, "bad_stamp", "imu/data").count == 1
    assert np.flatnonzero(result.imu.flags).tolist() == [20]
    assert result.axis == "recorder"


def test_unreadable_messages(tmp_path):
    messages = samples.robot_messages()
    with samples.McapRecording(tmp_path / "trial") as recording:
        for i, (arrival_ns, topic, message) in enumerate(messages):
            raw = bytes(samples.typestore().serialize_cdr(message, message.__msgtype__))
            cut = topic == "/fish/imu/data" and i > len(messages) - 100
            entry = recording.add_topic(topic, message.__msgtype__)
            recording.write(entry, arrival_ns, raw[:40] if cut else raw)
    result = read_trial(tmp_path / "trial")
    bad = problem(result, "unreadable", "imu/data")
    assert bad.severity == "error"
    assert bad.count == np.count_nonzero(result.imu.flags == trial.UNREADABLE) > 5
    assert len(result.imu) == 200
    assert np.isnan(result.imu.gyro[-1]).all()


@pytest.mark.parametrize(
    "topic", ["imu/data", "control/gains", "camera/pose", "camera/tail", "reference/path"]
)
def test_a_topic_that_cannot_be_decoded_at_all_costs_itself_only(tmp_path, topic):
    with samples.McapRecording(tmp_path / "trial") as recording:
        for arrival_ns, name, message in samples.robot_messages():
            raw = bytes(samples.typestore().serialize_cdr(message, message.__msgtype__))
            entry = recording.add_topic(name, message.__msgtype__)
            recording.write(entry, arrival_ns, raw[:17] if name == f"/fish/{topic}" else raw)
    result = read_trial(tmp_path / "trial")
    bad = problem(result, "unreadable", topic)
    counted = next(summary for summary in result.topics if summary.topic == f"/fish/{topic}")
    assert bad.severity == "error"
    assert bad.count == counted.count
    whole = read_trial(samples.robot_recording(tmp_path / "whole"))
    roles = {rule.topic: role for role, rule in TopicMap().rules.items()}
    assert set(result.streams) == set(whole.streams) - {roles[topic]}
    assert (
        result.reference_paths == ()
        if topic == "reference/path"
        else len(result.reference_paths) == 1
    )


def test_constant_commands(tmp_path):
    def still(i, t, m):
        return t, build.joints(samples.ns(i * 0.01), ["rotor", "rudder"], [0.0, 0.1], [5.0, 0.0])

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/joint_command", still))
    kinds = [p for p in result.problems if p.kind == "constant_command"]
    assert {p.severity for p in kinds} == {"warning", "info"}
    assert "5 rad/s throughout" in kinds[0].text


def test_rotor_that_turns_against_its_command(tmp_path):
    def mirrored(i, t, m):
        return t, build.joints(
            samples.ns(i * 0.01), ["rotor"], [0.0], [-samples.rotor_speed(i * 0.01)]
        )

    result = read(
        tmp_path, samples.changed(samples.robot_messages(), "/fish/joint_states", mirrored)
    )
    assert problem(result, "rotor_sign").severity == "error"


def test_swapped_markers_are_jumps(tmp_path):
    def flipped(i, t, m):
        if i in (20, 21):
            m.pose.pose = build.pose(*(samples.pose(0.005 + i / 30) + [0, 0, np.pi]))
        return t, m

    result = read(tmp_path, samples.changed(samples.robot_messages(), "/fish/camera/pose", flipped))
    assert problem(result, "jump", "camera/pose").count == 2
    assert np.flatnonzero(result.camera.flags).tolist() == [20, 21]


def test_a_fast_wriggling_fish_does_not_jump():
    t = np.arange(0, 10, 1 / 11)
    x, y = 0.5 * t, 0.05 * np.sin(12 * t)
    psi = (
        0.35 * np.sin(2 * np.pi * 2.5 * t) + 0.6 * t
    )  # stroke and turn of the real robot, sampled at 11 Hz
    assert not find_jumps(t, x, y, np.mod(psi, 2 * np.pi)).any()


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
        ({"encoder": lambda a, s: (-a if s > 0.0 else np.nan, s)}, {"encoder_sign"}),
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
        ({"encoder": lambda a, s: (1.5 if s > 0.0 else np.nan, s)}, "rotor angle is"),
        ({"pose": lambda p: 0 * p + 0.3}, "pose is"),
        ({"pose": lambda p: p * [1, 1, 0]}, "heading is"),
    ],
)
def test_a_sensor_that_gives_one_value_is_named(tmp_path, fault, words):
    trial = read_trial(samples.write_mcap(tmp_path / "trial", swim(**fault)))
    assert [words in p.text for p in trial.problems if p.kind == "stuck"] == [True]


def freezes(every=1, held=1, still=False, until=np.inf, noisy=False):
    """Every `every`-th Imu message; a value lasts for `held` of them, and from 1 s until `until` for good.

    The rotor may stand, or no encoder may say whether it does while the accelerometer is noisy.
    """
    out, value, count = [], None, 0
    for t, topic, m in samples.robot_messages(4.0):
        if still and topic in ("/fish/joint_command", "/fish/joint_states"):
            m.velocity[0] = 0.0
        if noisy and topic == "/fish/joint_states":
            continue
        if topic == "/fish/imu/data":
            m.linear_acceleration.z += 1e-3 * (count % 7) * noisy
            now = 0.01 * count
            if not 1.0 <= now < until and count % (every * held) == 0:
                value = m.angular_velocity
            m.angular_velocity, count = value, count + 1
            if (count - 1) % every:
                continue
        out.append((t, topic, m))
    return out


@pytest.mark.parametrize(("every", "held"), [(1, 1), (10, 1), (1, 10)])
def test_a_gyro_that_freezes_is_flagged_from_then_on(tmp_path, every, held):
    found = read_trial(samples.write_mcap(tmp_path / "trial", freezes(every, held, until=3.0)))
    (said,) = (p for p in found.problems if p.kind == "frozen")
    flagged = found.imu.t[found.imu.flags == FROZEN]
    assert said.count == len(flagged)
    assert "gyro z stay at one value while the rotor moves" in said.text
    assert 0.89 < flagged.min() < 1.2
    assert 2.88 < flagged.max() < 3.0
    assert np.all(np.diff(flagged) < 0.101)


@pytest.mark.parametrize(
    "still",
    [
        {"held": 90, "until": 1.0},
        {"every": 10, "until": 1.9},
        {"still": True},
        {"until": 1.9},
        {"until": 3.0, "noisy": True},
    ],
)
def test_values_that_are_held_and_a_fish_at_rest_are_no_frozen_gyro(tmp_path, still):
    found = read_trial(samples.write_mcap(tmp_path / "trial", freezes(**still)))
    assert not any(p.kind == "frozen" for p in found.problems)
    assert not found.imu.flags.any()


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


QUARTER = np.array(
    [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
)  # body axes in those of an IMU turned to the left


def imu(trial, gyro=lambda g: g, accel=lambda a: a):
    changed = replace(trial.imu, gyro=gyro(trial.imu.gyro), accel=accel(trial.imu.accel))
    return replace(trial, imu=changed)


def camera(trial, pose):
    seen = pose(trial.camera.pose)
    psi = np.mod(seen[:, 2] + np.pi, 2 * np.pi) - np.pi
    jumps = find_jumps(trial.camera.t, seen[:, 0], seen[:, 1], psi)
    flags = np.where(jumps, JUMP, 0).astype(np.uint8)
    changed = replace(trial.camera, x=seen[:, 0], y=seen[:, 1], psi=psi, flags=flags)
    return replace(trial, camera=changed)


def commands(trial, rotor=1.0, rudder=lambda a: a):
    old = trial.commands
    changed = replace(old, rotor_speed=rotor * old.rotor_speed, rudder=rudder(old.rudder))
    return replace(trial, commands=changed)


def rotor(trial, factor):
    old = trial.encoder
    changed = replace(old, speed=factor * old.speed, angle=factor * old.angle)
    return replace(commands(trial, rotor=factor), encoder=changed)


def findings(trial):
    found = [*check_sensors(trial), *check_rotor_sign(trial.commands, trial.encoder)]
    return {(problem.severity, problem.kind): problem.text for problem in found}


FAULTS = {
    "gyro in deg/s": (lambda s: imu(s, gyro=np.degrees), "error", "gyro_unit", "57."),
    "gyro z down": (lambda s: imu(s, gyro=lambda g: -g), "error", "gyro_sign", "change the sign"),
    "gyro z and y swapped": (
        lambda s: imu(s, gyro=lambda g: g[:, [0, 2, 1]]),
        "error",
        "gyro_axes",
        "its axis y",
    ),
    "IMU turned by 90 deg": (
        lambda s: imu(s, lambda g: g @ QUARTER.T, lambda a: a @ QUARTER.T),
        "error",
        "accel_axes",
        "turned by 90 deg",
    ),
    "IMU turned by -90 deg": (
        lambda s: imu(s, lambda g: g @ QUARTER, lambda a: a @ QUARTER),
        "error",
        "accel_axes",
        "turned by -90 deg",
    ),
    "IMU turned by 180 deg": (
        lambda s: imu(s, lambda g: g * [-1, -1, 1], lambda a: a * [-1, -1, 1]),
        "error",
        "accel_axes",
        "turned by 180 deg",
    ),
    "accelerometer x and y swapped": (
        lambda s: imu(s, accel=lambda a: a[:, [1, 0, 2]]),
        "error",
        "accel_axes",
        "x and y swapped",
    ),
    "accelerometer x mirrored": (
        lambda s: imu(s, accel=lambda a: a * [-1, 1, 1]),
        "error",
        "accel_axes",
        "the other sign of x",
    ),
    "accelerometer y mirrored": (
        lambda s: imu(s, accel=lambda a: a * [1, -1, 1]),
        "error",
        "accel_axes",
        "the other sign of y",
    ),
    "accelerometer z down": (
        lambda s: imu(s, accel=lambda a: a * [1, -1, -1]),
        "error",
        "accel_axes",
        "along -z",
    ),
    "accelerometer in g": (
        lambda s: imu(s, accel=lambda a: a / 9.81),
        "error",
        "accel_unit",
        "(g?)",
    ),
    "accelerometer in mg": (
        lambda s: imu(s, accel=lambda a: a / 9.81e-3),
        "error",
        "accel_unit",
        "thousandths of g",
    ),
    "accelerometer without gravity": (
        lambda s: imu(s, accel=lambda a: a - [0, 0, 9.81]),
        "error",
        "accel_unit",
        "gravity taken out",
    ),
    "camera in feet": (
        lambda s: camera(s, lambda p: p * [3.281, 3.281, 1]),
        "error",
        "camera_unit",
        "feet",
    ),
    "camera in inches": (
        lambda s: camera(s, lambda p: p * [39.37, 39.37, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera in cm": (
        lambda s: camera(s, lambda p: p * [100, 100, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera in mm": (
        lambda s: camera(s, lambda p: p * [1000, 1000, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera y mirrored, heading not": (
        lambda s: camera(s, lambda p: p * [1, -1, 1]),
        "error",
        "camera_axes",
        "mirrored or swapped",
    ),
    "camera x and y swapped, heading not": (
        lambda s: camera(s, lambda p: p[:, [1, 0, 2]]),
        "error",
        "camera_axes",
        "mirrored or swapped",
    ),
    "left-handed camera": (
        lambda s: camera(s, lambda p: p * [1, -1, -1]),
        "error",
        "camera_axes",
        "left-handed",
    ),
    "heading in deg": (
        lambda s: camera(s, lambda p: p * [1, 1, np.degrees(1)]),
        "error",
        "camera_heading",
        "57.3 times",
    ),
    "marker turned by 180 deg": (
        lambda s: camera(s, lambda p: p + [0, 0, np.pi]),
        "error",
        "camera_heading",
        "180 deg",
    ),
    "rudder in deg": (
        lambda s: commands(s, rudder=np.degrees),
        "error",
        "rudder_unit",
        "deg?",
    ),
    "rudder in servo pulses": (
        lambda s: commands(s, rudder=lambda a: 1500 + 500 * a),
        "error",
        "rudder_unit",
        "servo pulses",
    ),
    "rudder from -1 to 1": (
        lambda s: commands(s, rudder=lambda a: np.clip(5 * a, -1, 1)),
        "warning",
        "rudder_unit",
        "-1 to 1",
    ),
    "rudder to the other side": (
        lambda s: commands(s, rudder=lambda a: -a),
        "error",
        "rudder_sign",
        "against the rudder",
    ),
    "rotor in deg/s": (lambda s: rotor(s, 57.3), "error", "rotor_unit", "deg/s"),
    "rotor in rpm": (lambda s: rotor(s, 9.549), "warning", "rotor_unit", "rpm"),
    "encoder's angle in deg": (
        lambda s: replace(s, encoder=replace(s.encoder, angle=np.degrees(s.encoder.angle))),
        "error",
        "encoder_unit",
        "change of the rotor's angle is 57",
    ),
    "rotor turned round": (lambda s: rotor(s, -1.0), "error", "rotor_sign", "hull turns with"),
    "command in rpm": (lambda s: commands(s, rotor=9.549), "error", "rotor_unit", "rpm"),
    "tail in deg": (
        lambda s: replace(s, tail=replace(s.tail, angle=np.degrees(s.tail.angle))),
        "error",
        "tail_unit",
        "deg",
    ),
    "tail to the other side": (
        lambda s: replace(s, tail=replace(s.tail, angle=-s.tail.angle)),
        "error",
        "tail_sign",
        "wrong sign",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_and_named(name):
    fault, severity, kind, words = FAULTS[name]
    assert words in findings(fault(stroke_swim())).get((severity, kind), "")


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "course",
    [
        Course(),
        Course(duration=6.0),
        Course(turns=0.0, speeds=0.0),
        Course(turns=0.0),
        Course(turns=3.0, speeds=0.0),
        Course(rotor=15.0),
        Course(rotor=0.0),
        Course(duration=90.0),
    ],
    ids=str,
)
def test_a_faultless_swim_has_no_finding(course, seed):
    assert findings(stroke_swim(course, seed)) == {}


def test_a_left_handed_camera_is_one_finding():
    found = findings(camera(stroke_swim(), lambda p: p * [1, -1, -1]))
    assert set(found) == {("error", "camera_axes")}


@pytest.mark.parametrize("seed", range(3))
def test_an_imu_that_pauses_blames_no_gyro(seed):
    swim = stroke_swim(seed=seed)
    heard = (swim.imu.t < swim.imu.t[0] + 5.0) | (swim.imu.t > swim.imu.t[0] + 7.0)
    assert findings(replace(swim, imu=swim.imu.take(np.flatnonzero(heard)))) == {}


def test_a_heading_in_degrees_blames_nothing_else():
    found = findings(camera(stroke_swim(), lambda p: p * [1, 1, np.degrees(1)]))
    assert set(found) == {("error", "camera_heading")}


@pytest.mark.parametrize("seed", range(3))
def test_a_fish_that_glides_straight_ahead_tells_no_directions(seed):
    """No turns, one speed, no strokes: the accelerometer may lie in any direction."""
    swim = stroke_swim(Course(turns=0.0, speeds=0.0, rotor=0.0), seed)
    for direction in (np.diag([-1, -1, 1]), QUARTER):
        assert findings(imu(swim, accel=lambda a, d=direction: a @ d)) == {}


def test_a_straight_swim_leaves_two_directions():
    """Strokes push the head sideways only, so that y is known to be wrong, and x may be either way."""
    swim = stroke_swim(Course(turns=0.0, speeds=0.0))
    text = findings(imu(swim, accel=lambda a: a * [-1, -1, 1]))["error", "accel_axes"]
    assert "turned by 180 deg" in text
    assert "the other sign of y" in text


def test_a_sensor_of_its_own_tells_nothing():
    """Without a camera no record shows the accelerometer's direction, without an IMU none the camera's feet."""
    swim = stroke_swim()
    alone = replace(imu(swim, accel=lambda a: a * [-1, -1, 1]), camera=None)
    assert findings(alone) == {}
    feet = replace(camera(swim, lambda p: p * [3.281, 3.281, 1]), imu=None)
    assert findings(feet) == {}


def test_roll_that_mixes_gravity_into_y_is_no_wrong_sign():
    """A hull that leans into its turns feels gravity sideways, several times the acceleration of the turn."""
    swim = stroke_swim(Course(rotor=0.0))
    roll = 0.1 * np.sin(0.5 * swim.imu.t)
    rate = np.gradient(roll, swim.imu.t)[:, None] * [1, 0, 0]
    leaning = imu(swim, lambda g: g + rate, lambda a: a - 9.81 * roll[:, None] * [0, 1, 0])
    assert findings(leaning) == {}
