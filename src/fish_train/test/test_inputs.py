"""Recordings as an experiment: what cannot be used is said, and robots are not mixed."""

import pytest
import recording_samples as samples

from fish_train.commands.inputs import read_experiment
from fish_train.errors import UserError


def test_what_cannot_be_read_is_left_out_and_said(tmp_path):
    for name in ("a", "b"):
        samples.robot_recording(tmp_path / name)
    broken = next(samples.robot_recording(tmp_path / "c").rglob("*.mcap"))
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    experiment, left_out = read_experiment(tmp_path)
    assert experiment.names == ("a", "b")
    assert len(left_out) == 1 and "c left out" in left_out[0] and "recover" in left_out[0]


def test_two_robots_are_refused_also_from_two_folders(tmp_path):
    for robot in ("pike", "trout"):
        messages = samples.robot_messages()
        samples.write_mcap(tmp_path / robot / "a", messages, {"robot": robot})
    with pytest.raises(UserError, match="trials differ in robot .*pike.*trout.*; expected one robot"):
        read_experiment(tmp_path / "pike", tmp_path / "trout")


def test_a_set_without_a_usable_trial_says_why(tmp_path):
    messages = [m for m in samples.robot_messages() if m[1] != "/fish/camera/pose"]
    samples.write_mcap(tmp_path / "a", messages)
    with pytest.raises(UserError, match="no trial can be used: .*camera"):
        read_experiment(tmp_path)
