# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults in a recording: each is named, counted and flagged, and no sample is lost."""

import numpy as np
import pytest

from fish_bag import TopicMap, read_trial, trial
from fish_bag import message_build as build
from fish_bag import sample_recordings as samples
from fish_bag.camera_checks import find_jumps


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
