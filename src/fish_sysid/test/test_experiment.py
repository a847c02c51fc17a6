# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Experiments from trials, and from recordings."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_bag import message_build as build
from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.trial import Trial
from fish_report import robofish as command
from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sim.robot_file import save_robot
from fish_sysid.dataset.experiment import (
    Experiment,
    ExperimentError,
    Headings,
    build_experiment,
    shorten,
)
from fish_sysid.dataset.read import heading, read_days, read_experiment


def without(
    topic: str, first: float = 0.0, last: float = np.inf, duration: float = 2.0
) -> list[samples.Message]:
    """A robot's messages less those of a topic with stamps in [first, last) [s]."""
    messages = samples.robot_messages(duration)

    def stamp(message: object) -> float:
        return (
            message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec - 1e-9 * samples.START_NS
        )

    def stays(name: str, message: object) -> bool:
        return name != f"/fish/{topic}" or not first - 1e-6 <= stamp(message) < last - 1e-6

    return [(t, name, message) for t, name, message in messages if stays(name, message)]


def read(folder: Path, messages: list[samples.Message]) -> Trial:
    return read_trial(samples.write_mcap(folder, messages))


def posed(
    pose: Callable[[float], np.ndarray], duration: float = 2.0, rate: float = 30.0
) -> list[samples.Message]:
    """A robot's messages with these poses instead of its own."""
    others = [m for m in samples.robot_messages(duration) if m[1] != "/fish/camera/pose"]
    seen = [
        (
            samples.ns(t + 0.025),
            "/fish/camera/pose",
            build.camera_pose(samples.ns(t), "pool", pose(t), (4e-6, 4e-6, 1.44e-4)),
        )
        for t in np.arange(0.005, duration, 1.0 / rate)
    ]
    return sorted([*others, *seen], key=lambda m: m[0])


def moved(messages, metres, topic="/fish/camera/pose"):
    """The messages with what the camera shows moved along x, so that no two recordings have the same images."""
    for _, name, message, *_ in messages:
        if name == topic:
            message.pose.pose.position.x += metres
    return messages


@pytest.fixture(scope="module")
def swum(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """Five seconds, in which the heading passes pi."""
    folder = tmp_path_factory.mktemp("swum") / "trial"
    return build_experiment([read(folder, samples.robot_messages(5.0))])


def test_every_sensor_stands_at_its_own_grid_point(swum: Experiment) -> None:
    t = 0.01 * np.arange(500)
    assert swum.steps.tolist() == [501]  # the last command is followed for one more step
    np.testing.assert_allclose(swum.commands[:500, 0, 0], samples.rotor_speed(t), atol=1e-9)
    np.testing.assert_allclose(swum.commands[:500, 0, 1], samples.rudder(t), atol=1e-9)
    np.testing.assert_array_equal(swum.commands[500], swum.commands[499])
    np.testing.assert_allclose(swum.encoder[:500, 0], samples.rotor_speed(t) - 0.5, atol=1e-9)
    np.testing.assert_allclose(swum.gyro[:500, 0], t, atol=1e-9)
    np.testing.assert_allclose(swum.accel[:500, 0], np.column_stack([np.ones(500), t]), atol=1e-9)
    assert np.isnan(swum.gyro[500]).all()
    assert np.isnan(swum.encoder[500]).all()


def test_images_keep_their_own_times_and_headings_do_not_wrap(swum: Experiment) -> None:
    (frames,) = swum.frames
    np.testing.assert_allclose(frames.t, np.arange(0.005, 5.0, 1 / 30), atol=1e-8)
    pose = samples.pose(frames.t)
    np.testing.assert_allclose(frames.pose[:, :2], pose[:, :2], atol=1e-9)
    np.testing.assert_allclose(frames.pose[:, 2], np.unwrap(pose[:, 2]), atol=1e-9)
    assert frames.pose[-1, 2] > np.pi > pose[-1, 2]


def test_the_grid_begins_with_the_first_command(tmp_path: Path) -> None:
    late = build_experiment([read(tmp_path / "late", without("joint_command", 0.0, 0.5))])
    assert late.steps.tolist() == [151]
    assert not late.start_at_rest
    np.testing.assert_allclose(late.gyro[:150, 0], 0.5 + 0.01 * np.arange(150), atol=1e-9)
    (frames,) = late.frames
    assert -0.005 <= frames.t[0] < 1 / 30
    np.testing.assert_allclose(frames.pose[:, :2], samples.pose(0.5 + frames.t)[:, :2], atol=1e-9)


def test_of_lost_commands_the_encoder_tells_the_rotor_and_a_line_the_rudder(tmp_path: Path) -> None:
    lost = build_experiment([read(tmp_path / "lost", without("joint_command", 1.0, 1.05))])
    whole = build_experiment([read(tmp_path / "whole", samples.robot_messages())])
    hole, t = slice(100, 105), 0.01 * np.arange(100, 105)
    np.testing.assert_allclose(lost.commands[hole, 0, 0], whole.encoder[101:106, 0], atol=1e-9)
    assert np.isnan(lost.encoder[101:106]).all()  # what was used is no measurement any more
    line = np.interp(t, [0.99, 1.05], samples.rudder(np.array([0.99, 1.05])))
    np.testing.assert_allclose(lost.commands[hole, 0, 1], line, atol=1e-9)
    kept = np.r_[0:100, 105:201]
    np.testing.assert_array_equal(lost.commands[kept], whole.commands[kept])
    kept = np.r_[0:101, 106:201]
    np.testing.assert_array_equal(lost.encoder[kept], whole.encoder[kept])


def test_a_trial_in_which_too_many_commands_were_lost_is_refused(tmp_path: Path) -> None:
    trial = read(tmp_path / "gap", without("joint_command", 1.0, 1.2))
    words = r"gap: no joint_command from 0\.99 to 1\.20 s, where one comes every 10 ms; expected at most 0\.1 s without; cut"
    with pytest.raises(ExperimentError, match=words):
        build_experiment([trial])


def test_a_recording_of_a_controller_that_lagged_is_used_and_said(tmp_path: Path) -> None:
    """Half of the commands are recorded, at random; the rotor followed all of them."""
    random = np.random.default_rng(0)
    messages = [
        m
        for m in samples.robot_messages(3.0)
        if m[1] != "/fish/joint_command" or random.random() < 0.5
    ]
    samples.write_mcap(tmp_path / "late", messages)
    experiment, left_out = read_experiment(tmp_path / "late")
    assert np.isnan(experiment.encoder).all()
    (text,) = [text for text in left_out if "commands come irregularly" in text]
    assert heading(text) == "Used with a fault"


def test_trials_stand_side_by_side_padded_to_the_longest(tmp_path: Path) -> None:
    short, long = (
        read(tmp_path / n, samples.robot_messages(s)) for n, s in (("short", 1.0), ("long", 2.0))
    )
    both = build_experiment([short, long])
    assert both.names == ("short", "long")
    assert both.steps.tolist() == [101, 201]
    assert both.length == 201
    assert np.isnan(both.gyro[101:, 0]).all()
    assert np.isfinite(both.gyro[:200, 1]).all()
    assert not both.commands[101:, 0].any()
    alone = both.select([0])
    assert alone.names == ("short",)
    assert alone.length == 101
    np.testing.assert_array_equal(alone.commands, build_experiment([short]).commands)


def test_the_rest_of_a_trial_begins_in_motion_with_its_own_clock(swum: Experiment) -> None:
    rest = replace(swum, start_at_rest=True).rest_of(0, 300)
    assert rest.steps.tolist() == [201]
    assert not rest.start_at_rest
    np.testing.assert_array_equal(rest.gyro, swum.gyro[300:])
    (frames,) = rest.frames
    assert 0.0 <= frames.t[0] < 1 / 30
    np.testing.assert_allclose(frames.pose[:, :2], samples.pose(3.0 + frames.t)[:, :2], atol=1e-9)


def test_a_shortened_experiment_has_its_first_steps(swum: Experiment) -> None:
    turned = Headings(0.01 * np.arange(500), np.zeros(500))
    begun = shorten(replace(swum, headings=(turned,)), 120)
    assert begun.steps.tolist() == [120]
    assert len(begun.headings[0].t) == len(begun.headings[0].psi) == 120
    np.testing.assert_array_equal(begun.commands, swum.commands[:120])
    assert shorten(swum, 1000).steps.tolist() == [501]


def test_a_fish_that_swims_already_is_not_at_rest(swum: Experiment, tmp_path: Path) -> None:
    """At 0.24 m/s from the first pose on, though it does not turn yet."""
    assert swum.gyro[0, 0] == 0.0
    assert not swum.start_at_rest
    begun = build_experiment(
        [read(tmp_path / "begun", posed(lambda t: samples.pose(max(t - 0.4, 0.0))))]
    )
    assert begun.start_at_rest


def test_a_fast_camera_is_thinned_and_one_that_keeps_to_the_grid_is_not(tmp_path: Path) -> None:
    for rate, every in ((60.0, 1 / 60.0), (100.0, 0.01), (120.0, 2 / 120.0), (240.0, 3 / 240.0)):
        (frames,) = build_experiment(
            [read(tmp_path / f"{rate:g}", posed(samples.pose, rate=rate))]
        ).frames
        np.testing.assert_allclose(np.diff(frames.t), every, atol=1e-8)
        np.testing.assert_allclose(frames.pose[:, :2], samples.pose(frames.t)[:, :2], atol=1e-9)


def test_a_fish_that_is_neither_seen_nor_felt_turn_is_refused(tmp_path: Path) -> None:
    late = without("camera/pose", 0.0, 1.5, duration=3.0)
    assert build_experiment([read(tmp_path / "felt", late)]).frames[0].t[0] > 1.5
    blind = read(tmp_path / "blind", [m for m in late if m[1] != "/fish/imu/data"])
    with pytest.raises(
        ExperimentError,
        match=r"blind: the first camera pose comes 1.5 s after .* no gyro .* within 1 s",
    ):
        build_experiment([blind])


def test_who_knows_no_rate_does_not_start_at_rest_unless_told(tmp_path: Path) -> None:
    still = posed(lambda t: np.zeros(3))
    blind = read(tmp_path / "blind", [m for m in still if m[1] != "/fish/imu/data"])
    assert build_experiment([read(tmp_path / "felt", still)]).start_at_rest
    assert not build_experiment([blind]).start_at_rest
    assert build_experiment([blind], start_at_rest=True).start_at_rest
    assert np.isnan(build_experiment([blind]).accel).all()


@pytest.mark.parametrize(
    ("topic", "first", "text"),
    [
        ("joint_command", 0.0, "no joint_command; the inputs"),
        ("camera/pose", 0.0, "no camera/pose; at least three poses"),
        ("camera/pose", 0.05, "2 of 2 camera poses lie between .*; at least three"),
        ("joint_command", 0.05, "2 of 60 camera poses lie between the first and the last command"),
    ],
)
def test_recordings_without_inputs_or_poses_are_refused(
    tmp_path: Path, topic: str, first: float, text: str
) -> None:
    with pytest.raises(ExperimentError, match=f"few: {text}"):
        build_experiment([read(tmp_path / "few", without(topic, first))])


def test_no_trial_is_refused() -> None:
    with pytest.raises(ExperimentError, match="no trial with data"):
        build_experiment([])


def test_what_cannot_be_read_is_left_out_and_said(tmp_path):
    for i, name in enumerate(("a", "b")):
        samples.write_mcap(tmp_path / name, moved(samples.robot_messages(), 0.001 * i))
    broken = next(samples.robot_recording(tmp_path / "c").rglob("*.mcap"))
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    experiment, left_out = read_experiment(tmp_path)
    assert experiment.names == ("a", "b")
    assert len(left_out) == 1
    assert "c left out" in left_out[0]
    assert "recover" in left_out[0]


def test_samples_that_come_twice_are_said_and_used_once(tmp_path):
    twice = [m for m in samples.robot_messages() for _ in range(1 + ("camera/pose" in m[1]))]
    samples.robot_recording(tmp_path / "once" / "a")
    samples.write_mcap(tmp_path / "twice" / "a", twice)
    once, nothing = read_experiment(tmp_path / "once")
    both, said = read_experiment(tmp_path / "twice")
    assert nothing == []
    assert len(said) == 1
    assert "a /fish/camera/pose" in said[0]
    assert "repeat an earlier one" in said[0]
    assert np.array_equal(both.frames[0].pose, once.frames[0].pose)


def test_recordings_of_a_laboratory_with_its_own_names(tmp_path, capsys):
    samples.robot_recording(tmp_path / "ours" / "a")
    own = {"/fish/camera/pose": "/tracking/head", "/fish/joint_command": "/fish/motors"}
    messages = [(t, own.get(topic, topic), *rest) for t, topic, *rest in samples.robot_messages()]
    samples.write_mcap(tmp_path / "theirs" / "a", messages)
    names = tmp_path / "topics.yaml"
    names.write_text("topics: {camera: {topic: /tracking/head}, commands: {topic: motors}}\n")
    for folder, options in (
        ("ours", []),
        ("theirs", ["--topics", str(names), "--namespace", "/fish"]),
    ):
        out = ["--out", str(tmp_path / folder / "robot"), "--hold-out", "0"]
        assert command.main(["identify", str(tmp_path / folder), *out, *options]) == 0
    fits = [
        (tmp_path / folder / "robot" / "robot.yaml").read_text() for folder in ("ours", "theirs")
    ]
    assert fits[0] == fits[1]
    assert command.main(["diagnose", str(tmp_path / "theirs"), "--out", str(tmp_path / "out")]) == 1
    assert "no trial can be used" in capsys.readouterr().err


def test_two_robots_are_refused_also_from_two_folders(tmp_path):
    for robot in ("pike", "trout"):
        messages = samples.robot_messages()
        samples.write_mcap(tmp_path / robot / "a", messages, {"robot": robot})
    with pytest.raises(
        UserError, match=r"trials differ in robot .*pike.*trout.*; expected one robot"
    ):
        read_experiment(tmp_path / "pike", tmp_path / "trout")


def test_a_set_without_a_usable_trial_says_why(tmp_path):
    messages = [m for m in samples.robot_messages() if m[1] != "/fish/camera/pose"]
    samples.write_mcap(tmp_path / "a", messages)
    with pytest.raises(UserError, match=r"no trial can be used: .*camera"):
        read_experiment(tmp_path)


def _in_another_frame(i, t, m):
    m.header = build.header(samples.ns(0.01 * i), "world")
    return t, m


def _of_no_number(i, t, m):
    m.pose.pose.position.x = np.nan
    return t, m


def _of_another_type(i, t, m):
    return t, build.number(1.0)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (_in_another_frame, "in frame 'world', expected 'pool'"),
        (_of_no_number, "carry NaN, infinity or lack a value"),
        (_of_another_type, "of type std_msgs/msg/Float64, expected geometry_msgs"),
    ],
)
def test_poses_that_came_and_are_not_used_are_said(tmp_path, change, text):
    messages = samples.changed(samples.robot_messages(), "/fish/camera/pose", change)
    samples.write_mcap(tmp_path / "a", messages)
    with pytest.raises(
        UserError, match=f"at least three poses are needed; /fish/camera/pose: .*{text}"
    ):
        read_experiment(tmp_path)


def _in_the_frame_imu(i, t, m):
    m.header.frame_id = "imu"
    return t, m


def _not_measured(i, t, m):
    m.linear_acceleration_covariance[0] = -1.0
    return t, m


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (_in_the_frame_imu, "200 of 200 messages in frame 'imu', expected 'imu_link'"),
        (_not_measured, "200 of 200 messages say by a covariance of -1"),
        (_of_another_type, "200 messages of type std_msgs/msg/Float64, expected sensor_msgs"),
    ],
)
def test_an_imu_that_came_and_is_not_used_is_said_of_a_trial_that_is(tmp_path, change, text):
    messages = samples.changed(samples.robot_messages(), "/fish/imu/data", change)
    samples.write_mcap(tmp_path / "a", messages)
    experiment, (said,) = read_experiment(tmp_path)
    assert np.isnan(experiment.gyro).all()
    assert said.startswith(f"a /fish/imu/data: {text}")
    assert said.endswith("; not used; the rest of the recording is")
    assert heading(said) == "Used with a fault"


def test_an_imu_that_cannot_be_decoded_is_said_of_a_trial_that_is_used(tmp_path):
    with samples.McapRecording(tmp_path / "a") as recording:
        for arrival_ns, topic, message in samples.robot_messages():
            raw = bytes(samples.typestore().serialize_cdr(message, message.__msgtype__))
            entry = recording.add_topic(topic, message.__msgtype__)
            recording.write(entry, arrival_ns, raw[:17] if topic == "/fish/imu/data" else raw)
    _, (said,) = read_experiment(tmp_path)
    assert said.startswith("a /fish/imu/data: none of 200 messages can be decoded")
    assert heading(said) == "Used with a fault"


def test_an_encoder_without_an_angle_is_used(tmp_path):
    def without_angle(i, t, m):
        m.position = np.zeros(0)
        return t, m

    messages = samples.changed(samples.robot_messages(), "/fish/joint_states", without_angle)
    samples.write_mcap(tmp_path / "a", messages)
    experiment, said = read_experiment(tmp_path)
    assert np.isfinite(experiment.encoder[:200]).all()
    assert said == []


def test_trials_of_one_name_are_told_apart_by_their_folders(tmp_path):
    for i, place in enumerate(("may/swims/a", "june/swims/a", "june/swims/b")):
        samples.write_mcap(tmp_path / place, moved(samples.robot_messages(), 0.001 * i))
    experiment, _ = read_experiment(tmp_path / "may" / "swims", tmp_path / "june" / "swims")
    assert experiment.names == ("may/swims/a", "june/swims/a", "b")


def test_a_recording_given_twice_is_refused(tmp_path):
    samples.robot_recording(tmp_path / "a")
    with pytest.raises(UserError, match="a: given twice; expected every recording once"):
        read_experiment(tmp_path, tmp_path / "a")


def test_a_copy_in_one_data_set_is_refused(tmp_path):
    """One could be held out while the other trains."""
    samples.robot_recording(tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    with pytest.raises(UserError, match=r"b and .*a: the same recording; expected every recording"):
        read_experiment(tmp_path)


@pytest.mark.parametrize("copy_first", [True, False])
def test_a_copy_of_a_part_is_refused(tmp_path, copy_first):
    messages, names = samples.robot_messages(), ("b", "a") if copy_first else ("a", "b")
    for name, part in zip(names, (messages, messages[300:-60]), strict=True):
        samples.write_mcap(tmp_path / name, part)
    text = r"b and .*a: the same recording in part, \d+ of \d+ moves between images; expected every"
    with pytest.raises(UserError, match=text):
        read_experiment(tmp_path)


def test_rest_at_one_place_and_a_short_overlap_make_no_copies(tmp_path):
    def rests(x: float) -> Callable[[float], np.ndarray]:
        return lambda t: np.array([0.3 + x * max(t - 1.5, 0.0), 0.2, 0.1])

    for i, x in enumerate((0.1, 0.2)):
        samples.write_mcap(tmp_path / "rest" / f"{i}", posed(rests(x)))
    assert len(read_experiment(tmp_path / "rest")[0].names) == 2
    messages = samples.robot_messages(4.0)
    for name, part in (("a", messages[:1500]), ("b", messages[1000:])):
        samples.write_mcap(tmp_path / "overlap" / name, part)
    assert len(read_experiment(tmp_path / "overlap")[0].names) == 2


@pytest.mark.parametrize("word", ["/fish/", "camera"])
def test_a_trial_whose_clock_is_set_back_is_left_out(tmp_path, word):
    for name, by in (("a", 0.0), ("b", 0.5037), ("c", 0.055)):
        messages = moved(samples.robot_messages(3.0), 0.001 * len(name) + by)
        for t, topic, message in messages:
            if word in topic and hasattr(message, "header") and t > samples.ns(1.5):
                samples.shift_stamp(message, -by)
        samples.write_mcap(tmp_path / name, messages)
    experiment, said = read_experiment(tmp_path)
    assert experiment.names == ("a", "c")
    (left_out,) = (text for text in said if heading(text) == "Left out")
    assert left_out.startswith("b /fish/camera/pose")
    assert ("/fish/joint_command" in left_out) == (word == "/fish/")
    assert "the clock is set back by 0.5" in left_out
    assert "let the time service slew it, and record again" in left_out
    told = [text for text in said if text.startswith("c ")]
    assert any("/fish/camera/pose: the clock is set back by 0.05" in text for text in told)
    assert {heading(text) for text in told} == {"Used with a fault"}


def test_a_gyro_that_freezes_is_not_used_from_then_on(tmp_path):
    def freezes(i, t, m):
        m.angular_velocity.z = min(m.angular_velocity.z, 1.0)
        return t, m

    messages = samples.changed(samples.robot_messages(4.0), "/fish/imu/data", freezes)
    samples.write_mcap(tmp_path / "a", messages)
    experiment, (said,) = read_experiment(tmp_path)
    assert "gyro z stay at one value while the rotor moves" in said
    assert heading(said) == "Used with a fault"
    assert np.isfinite(experiment.gyro[:100]).all()
    assert not np.isfinite(experiment.gyro[110:]).any()


def test_dead_cameras_make_no_copies(tmp_path):
    for name in ("a", "b"):
        samples.write_mcap(tmp_path / name, posed(lambda t: np.array([0.1, 0.2, 0.3])))
    experiment, said = read_experiment(tmp_path)
    assert experiment.names == ("a", "b")
    assert all("is the sensor alive?" in text for text in said)


def test_an_imu_without_an_orientation_still_measures(tmp_path):
    """Level, as far as anybody knows: the rates and forces of the axes it was mounted by."""

    def unknown(i, t, m):
        if i % 2:
            m.orientation_covariance[0] = -1.0
        elif i % 4:
            m.orientation.z, m.orientation.w = 0.0, 1e-200  # rounding of none
        return t, m

    messages = samples.robot_messages()
    samples.write_mcap(tmp_path / "known" / "a", messages)
    samples.write_mcap(
        tmp_path / "half" / "a", samples.changed(messages, "/fish/imu/data", unknown)
    )
    known, half = (read_experiment(tmp_path / name)[0] for name in ("known", "half"))
    assert np.isfinite(half.gyro).sum() == np.isfinite(known.gyro).sum() > 100
    np.testing.assert_allclose(half.gyro, known.gyro, atol=1e-12)
    assert half.start_at_rest == known.start_at_rest


def test_a_unit_that_no_fit_can_mend_is_said_of_its_trial(tmp_path):
    def in_degrees(i, t, m):
        m.position = np.array([m.position[0], 20.0 * (-1) ** (i // 50)])
        return t, m

    messages = moved(samples.robot_messages(), 0.001)
    samples.robot_recording(tmp_path / "a")
    samples.write_mcap(tmp_path / "b", samples.changed(messages, "/fish/joint_command", in_degrees))
    experiment, said = read_experiment(tmp_path)
    assert experiment.names == ("a", "b")
    assert len(said) == 1
    assert "b /fish/joint_command" in said[0]
    assert "goes to 20 rad" in said[0]
    assert "publish rad" in said[0]


def test_a_dead_sensor_is_said_of_its_trial(tmp_path):
    def dead(i, t, m):
        m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z = 0.0, 0.0, 0.3
        return t, m

    messages = samples.changed(samples.robot_messages(), "/fish/imu/data", dead)
    samples.write_mcap(tmp_path / "a", messages)
    _, (said,) = read_experiment(tmp_path)
    assert heading(said) == "Used with a fault"
    assert "gyro is" in said
    assert "is the sensor alive?" in said


def test_an_effect_that_nobody_knows_is_refused_before_anything_is_read(tmp_path, capsys):
    for given in ("tip_slipp", "choose,tip_slip"):
        assert command.main(["identify", str(tmp_path), "--effects", given]) == 1
        assert f"unknown candidate '{given.split(',')[0]}'" in capsys.readouterr().err


def test_a_recording_of_two_days_is_refused_also_as_a_copy(tmp_path):
    for day in ("new", "old", "copy"):
        samples.write_mcap(tmp_path / day / "a", moved(samples.robot_messages(), len(day) * 0.001))
    read_days([tmp_path / "new"], [tmp_path / "copy"])
    shutil.copytree(tmp_path / "old" / "a", tmp_path / "copy" / "b")
    for olds in (["new"], ["old", "old"], ["old", "copy"]):
        with pytest.raises(UserError, match="same recording; expected every recording once"):
            read_days([tmp_path / "new"], [tmp_path / day for day in olds])


def test_a_unit_of_one_day_alone_makes_it_not_comparable(tmp_path):
    for day, metres in (("old", 0.0), ("new", 0.001)):
        samples.write_mcap(tmp_path / day / "a", moved(samples.robot_messages(), metres))
    assert read_days([tmp_path / "new"], [tmp_path / "old"])[2:] == ([], None)
    messages = moved(samples.robot_messages(), 0.002)
    for _, topic, message, *_ in messages:
        if topic == "/fish/imu/data":
            for axis in "xyz":
                force = message.linear_acceleration
                setattr(force, axis, getattr(force, axis) / 9.81)
    samples.write_mcap(tmp_path / "in_g" / "a", messages)
    _, _, told, why = read_days([tmp_path / "in_g"], [tmp_path / "old"])
    assert "(g?)" in why
    assert "in 1 of 1 trials of NEW and in none of OLD" in why
    assert [heading(text) for text in told] == ["Used with a fault"]
    assert told[0].startswith("NEW a /fish/imu/data")


def test_a_dead_sensor_of_one_day_is_not_hidden_by_another_of_the_other_day(tmp_path):
    def dead_gyro(i, t, m):
        m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z = 0.0, 0.0, 0.3
        return t, m

    def dead_encoder(i, t, m):
        m.velocity[:] = 0.0
        return t, m

    for day, topic, change in (
        ("new", "imu/data", dead_gyro),
        ("old", "joint_states", dead_encoder),
    ):
        messages = samples.changed(samples.robot_messages(), f"/fish/{topic}", change)
        samples.write_mcap(tmp_path / day / "a", moved(messages, 0.001 * (day == "new")))
    why = read_days([tmp_path / "new"], [tmp_path / "old"])[3]
    assert why is not None
    assert why.startswith("a /fish/imu/data: gyro is")
    assert "in 1 of 1 trials of NEW and in none of OLD" in why


def test_images_that_are_all_refused_say_why(tmp_path):
    messages = samples.robot_messages()
    random = np.random.default_rng(0)
    for _, topic, message, *_ in messages:
        if topic == "/fish/camera/pose":  # millimetres, with noise
            message.pose.pose.position.x = 1000.0 * random.uniform(-1.0, 1.0)
    samples.write_mcap(tmp_path / "a", messages)
    with pytest.raises(UserError, match=r"no camera/pose.*expected metres"):
        read_experiment(tmp_path)


def test_options_of_the_search_are_refused_with_a_baseline(tmp_path, capsys):
    for option, value in (
        ("--candidates", "payload"), ("--false-alarms", "0.1"), ("--without", "model order"),
    ):  # fmt: skip
        given = [str(tmp_path), "--baseline", str(tmp_path), "--out", str(tmp_path / "out")]
        assert command.main(["diagnose", *given, option, value]) == 1
        assert f"{option} goes without --baseline" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "taken"),
    [
        ("predict {0}/day --model {0}/model.yaml --out {0}/day/a/a.mcap", "day/a/a.mcap"),
        ("predict {0}/day/a --model {0}/model.yaml --out {0}/day/a/metadata.yaml", "metadata.yaml"),
        ("predict {0}/day/a --model {0}/model.yaml --out {0}/model.yaml", "model.yaml"),
        ("identify {0}/day --robot {0}/robot.yaml --out {0}", "robot.yaml"),
        ("diagnose {0}/day --robot {0}/model.yaml --out {0}", "model.yaml"),
        ("diagnose {0}/day --robot {0}/model.yaml --out {0} --baseline {0}/old", "model.yaml"),
        ("distinguish {0}/plan.json --out {0}/plan.json", "plan.json"),
        ("plan_calibration --robot {0}/robot.yaml --out {0}/robot.yaml", "robot.yaml"),
    ],
)
def test_no_verb_replaces_what_it_reads(tmp_path, capsys, words, taken):
    for day, metres in (("old", 0.0), ("day", 0.001)):
        samples.write_mcap(tmp_path / day / "a", moved(samples.robot_messages(), metres))
    for name in ("robot.yaml", "model.yaml"):
        save_robot(Robot(), tmp_path / name)
    row = {"t": 0, "amplitude": 8, "frequency": 2, "rudder": 0.3}
    (tmp_path / "plan.json").write_text(json.dumps([row]))
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    before = [path.read_bytes() for path in files]
    assert command.main(words.format(tmp_path).split()) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert f"{taken} is the input" in said
    assert "choose another --" in said
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == files
    assert [path.read_bytes() for path in files] == before


def test_a_verdict_without_a_model_leaves_none_of_an_earlier_one(tmp_path):
    for day, metres in (("old", 0.0), ("new", 0.001)):
        messages = moved(samples.robot_messages(), metres)
        for _, topic, message, *_ in messages:
            if day == "new" and topic == "/fish/imu/data":
                for axis in "xyz":
                    force = message.linear_acceleration
                    setattr(force, axis, getattr(force, axis) / 9.81)
        samples.write_mcap(tmp_path / day / "a", messages)
    out = tmp_path / "out"
    out.mkdir()
    save_robot(Robot(), out / "model.yaml")
    given = [str(tmp_path / "new"), "--baseline", str(tmp_path / "old"), "--out", str(out)]
    assert command.main(["diagnose", *given]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["diagnosis.json", "report.html"]
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["change"]["verdict"] == "not_comparable"
