# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Folders of trials: order, bad trials, mixed robots, several processes."""

import re
import shutil
import signal
from types import SimpleNamespace

import numpy as np
import pytest

from fish_bag import RecordingError, read_dataset, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.dataset import check_set
from fish_bag.recover import recover


def kinds(data):
    return [problem.kind for problem in data.problems]


def test_folder_of_trials(tmp_path):
    for name in ("trial_02", "trial_00", "trial_01"):
        samples.robot_recording(tmp_path / name, duration=0.3)
    (tmp_path / "notes.txt").write_text("not a trial")
    data = read_dataset(tmp_path)
    assert [trial.name for trial in data] == ["trial_00", "trial_01", "trial_02"]
    assert data.problems == ()
    assert data["trial_01"].path == tmp_path / "trial_01"
    with pytest.raises(KeyError, match="known: trial_00, trial_01"):
        data["trial_09"]


def test_one_trial_is_said(tmp_path):
    data = read_dataset(samples.robot_recording(tmp_path / "only", duration=0.3))
    assert (len(data), kinds(data)) == (1, ["one_trial"])


def test_unreadable_trial_is_left_out_and_said(tmp_path):
    for name in ("a", "b", "c"):
        samples.robot_recording(tmp_path / name, duration=0.3)
    file = tmp_path / "b" / "b.mcap"
    file.write_bytes(file.read_bytes()[:3000])
    data = read_dataset(tmp_path)
    assert [trial.name for trial in data] == ["a", "c"]
    assert kinds(data) == ["unreadable_trial"]
    assert "b left out" in data.problems[0].text
    assert "recover" in data.problems[0].text


@pytest.mark.parametrize("folder", ["empty", "missing"])
def test_nothing_to_read(tmp_path, folder):
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"no recording|does not exist"):
        read_dataset(tmp_path / folder)


def test_a_folder_of_bare_files_is_a_folder_of_trials(tmp_path):
    for name in ("trial_0", "trial_1"):
        made = samples.robot_recording(tmp_path / name, duration=0.3)
        (made / f"{name}.mcap").rename(tmp_path / f"{name}.mcap")
        shutil.rmtree(made)
    assert [trial.name for trial in read_dataset(tmp_path)] == ["trial_0", "trial_1"]
    with pytest.raises(RecordingError, match=r"2 storage files.*give one of the recordings in it"):
        read_trial(tmp_path)
    with pytest.raises(RecordingError, match=r"2 storage files.*give one of the recordings in it"):
        recover(tmp_path, tmp_path / "mended")


def test_parts_of_a_split_recording_are_one_recording(tmp_path):
    messages, folder = samples.robot_messages(0.4), tmp_path / "swim"
    folder.mkdir()
    for k, half in enumerate((messages[: len(messages) // 2], messages[len(messages) // 2 :])):
        made = samples.write_mcap(tmp_path / f"half_{k}", half)
        (made / f"half_{k}.mcap").rename(folder / f"swim_{k}.mcap")
    (trial,) = read_dataset(folder)
    assert sum(topic.count for topic in trial.topics) == len(messages)
    assert [p.text for p in trial.problems if p.kind == "storage"] == [
        "no metadata.yaml; swim_0.mcap, swim_1.mcap read in this order"
    ]
    assert recover(folder, tmp_path / "mended").count == len(messages)


def test_a_file_and_a_folder_of_one_name_are_told_apart(tmp_path):
    made = samples.robot_recording(tmp_path / "a", duration=0.3)
    shutil.copy(made / "a.mcap", tmp_path / "a.mcap")
    assert [trial.name for trial in read_dataset(tmp_path)] == ["a", "a.mcap"]


def test_mixed_robots(tmp_path):
    messages = samples.robot_messages(0.3)
    samples.write_mcap(tmp_path / "a", messages, {"robot": "trout"})
    samples.write_mcap(tmp_path / "b", messages, {"robot": "carp"})
    samples.write_mcap(tmp_path / "c", samples.robot_messages(0.3, namespace="/other"))
    data = read_dataset(tmp_path)
    assert kinds(data) == ["mixed_robots", "mixed_robots"]
    assert "carp: b; trout: a" in data.problems[0].text
    assert "/other: c" in data.problems[1].text


def kin(name: str, **changes) -> SimpleNamespace:
    """As much of a trial as a set is checked by."""
    tail = SimpleNamespace(names=("tail_1", "tail_2"))
    battery = SimpleNamespace(voltage=np.array([np.nan, 14.8, 14.6]))
    return SimpleNamespace(
        name=name, metadata={}, namespace="/fish", **{"tail": tail, "battery": battery} | changes
    )


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"tail": SimpleNamespace(names=("tail_1",))}, r"differ in tail segments \(1: b; 2: a\)"),
        (
            {"battery": SimpleNamespace(voltage=np.array([22.2]))},
            r"battery \(more than 4 cells: b; up to 4 cells: a\)",
        ),
    ],
)
def test_trials_of_robots_that_are_built_differently_are_no_set(changes, text):
    (problem,) = check_set([kin("a"), kin("b", **changes)])
    assert problem.kind == "mixed_robots"
    assert re.search(text, problem.text)


def test_a_set_whose_trials_know_less_of_the_robot_is_one():
    unknown = {"tail": None, "battery": SimpleNamespace(voltage=np.array([np.nan]))}
    assert list(check_set([kin("a"), kin("b", **unknown), kin("c", battery=None)])) == []


@pytest.mark.timeout(60)
def test_several_processes_read_where_sigterm_is_caught(tmp_path):
    """As in a process with a ROS node, whose handler children inherit."""
    for i in range(4):
        samples.robot_recording(tmp_path / f"trial_{i}", duration=0.2)
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        assert len(read_dataset(tmp_path, processes=2)) == 4
    finally:
        signal.signal(signal.SIGTERM, before)


def test_several_processes_read_the_same(tmp_path):
    for i in range(4):
        samples.robot_recording(tmp_path / f"trial_{i}", duration=0.2 + 0.1 * i)
    one, two = read_dataset(tmp_path, processes=1), read_dataset(tmp_path, processes=2)
    for a, b in zip(one, two, strict=True):
        assert a.name == b.name
        np.testing.assert_array_equal(a.imu.gyro, b.imu.gyro)
        assert a.problems == b.problems
        assert repr(a.topics) == repr(b.topics)
