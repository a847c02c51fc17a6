# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as an experiment: what cannot be used is said, and robots are not mixed."""

import shutil

import numpy as np
import pytest

from fish_bag import sample_recordings as samples
from fish_report import robofish as command
from fish_report.errors import UserError
from fish_sysid.dataset.read import heading, read_days, read_experiment


def test_what_cannot_be_read_is_left_out_and_said(tmp_path):
    for name in ("a", "b"):
        samples.robot_recording(tmp_path / name)
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


def test_trials_of_one_name_are_told_apart_by_their_folders(tmp_path):
    for place in ("may/swims/a", "june/swims/a", "june/swims/b"):
        samples.robot_recording(tmp_path / place)
    experiment, _ = read_experiment(tmp_path / "may" / "swims", tmp_path / "june" / "swims")
    assert experiment.names == ("may/swims/a", "june/swims/a", "b")


def test_a_recording_given_twice_is_refused(tmp_path):
    samples.robot_recording(tmp_path / "a")
    with pytest.raises(UserError, match="a: given twice; expected every recording once"):
        read_experiment(tmp_path, tmp_path / "a")


def test_an_imu_without_an_orientation_still_measures(tmp_path):
    """Level, as far as anybody knows: the rates and forces of the axes it was mounted by."""

    def unknown(i, t, m):
        if i % 2:
            m.orientation_covariance[0] = -1.0
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

    messages = samples.robot_messages()
    samples.robot_recording(tmp_path / "a")
    samples.write_mcap(tmp_path / "b", samples.changed(messages, "/fish/joint_command", in_degrees))
    experiment, said = read_experiment(tmp_path)
    assert experiment.names == ("a", "b")
    assert len(said) == 1
    assert "b /fish/joint_command" in said[0]
    assert "goes to 20 rad" in said[0]
    assert "publish rad" in said[0]


def test_an_effect_that_nobody_knows_is_refused_before_anything_is_read(tmp_path, capsys):
    for given in ("tip_slipp", "choose,tip_slip"):
        assert command.main(["identify", str(tmp_path), "--effects", given]) == 1
        assert f"unknown candidate '{given.split(',')[0]}'" in capsys.readouterr().err


def moved(messages, metres, topic="/fish/camera/pose"):
    """The messages with what the camera shows moved along x, so that no two days have the same images."""
    for _, name, message, *_ in messages:
        if name == topic:
            message.pose.pose.position.x += metres
    return messages


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
        ("--candidates", "payload"), ("--false-alarms", "0.1"), ("--without", "base restart"),
    ):  # fmt: skip
        given = [str(tmp_path), "--baseline", str(tmp_path), "--out", str(tmp_path / "out")]
        assert command.main(["diagnose", *given, option, value]) == 1
        assert f"{option} goes without --baseline" in " ".join(capsys.readouterr().err.split())
