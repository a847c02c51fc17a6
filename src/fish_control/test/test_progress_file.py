# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Progress on disk."""

import json
import os
import threading

import pytest

from fish_control.paths import make_path
from fish_control.planner import ProgressFile, path_digest


@pytest.fixture
def file(tmp_path):
    return tmp_path / "p.json"


def keep(keeper, *what):
    keeper.keep(*what)
    keeper.settle()


def test_what_is_kept_is_recalled_by_the_next_planner(file):
    keep(ProgressFile(file), "abc", 12.5, 1.25)
    assert ProgressFile(file).recall("abc", 14.0, oldest=10.0) == (1.25, 1.5)
    assert [f.name for f in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize(("digest", "time"), [("other", 14.0), ("abc", 23.0), ("abc", 12.0)])
def test_other_paths_old_progress_and_a_clock_behind_are_not_resumed(file, digest, time):
    keep(ProgressFile(file), "abc", 12.5, 1.25)
    assert ProgressFile(file).recall(digest, time, oldest=10.0) is None


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"path": "a"}',
        '{"path": "a", "time": "x", "progress": 1}',
        '{"path": "a", "time": 1, "progress": -1}',
        '{"path": "a", "time": 1, "progress": NaN}',
    ],
)
def test_damaged_files_are_no_progress(file, content):
    file.write_text(content)
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) is None


def test_no_file_is_no_progress(file):
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) is None


def test_it_writes_five_times_a_second_and_at_once_when_the_clock_is_set_back(file):
    keeper = ProgressFile(file)
    for k in range(16):
        keep(keeper, "a", 100.0 + 0.0625 * k, float(k))
    assert json.loads(file.read_text())["progress"] == 12.0
    keep(keeper, "a", 1.0, 99.0)
    assert json.loads(file.read_text())["progress"] == 99.0


def test_a_folder_that_cannot_be_written_is_said_and_not_fatal(tmp_path):
    keeper = ProgressFile(tmp_path / "missing" / "p.json")
    keep(keeper, "a", 1.0, 0.5)
    assert "cannot be kept" in keeper.problem


def test_forgotten_progress_is_gone(file):
    keeper = ProgressFile(file)
    keeper.forget()
    keep(keeper, "a", 1.0, 0.5)
    keeper.forget()
    assert keeper.recall("a", 1.0, oldest=10.0) is None  # whether the disk is done with it or not
    keeper.settle()
    assert not file.exists()
    keep(keeper, "a", 2.0, 0.7)
    assert keeper.recall("a", 2.0, oldest=10.0) == (0.7, 0.0)


def test_what_is_being_written_is_forgotten_too(file, monkeypatch):
    stalled, goes_on = threading.Event(), threading.Event()
    rename = os.replace
    monkeypatch.setattr(
        os, "replace", lambda *args: stalled.set() or (goes_on.wait(10.0) and rename(*args))
    )
    keeper = ProgressFile(file)
    keeper.keep("a", 1.0, 0.5)
    assert stalled.wait(10.0)
    keeper.forget()  # returns: the disk is not waited for
    goes_on.set()
    keeper.settle()
    assert not file.exists()


def test_a_file_that_cannot_be_removed_is_said_and_not_fatal(tmp_path):
    keeper = ProgressFile(tmp_path)  # a folder
    keeper.forget()
    keeper.settle()
    assert f"cannot be removed from {tmp_path}" in keeper.problem


def test_a_disk_that_stalls_does_not_hold_up_the_planner(file, monkeypatch):
    stalled, goes_on = threading.Event(), threading.Event()

    def replace(*args):
        stalled.set()
        goes_on.wait()
        rename(*args)

    rename = os.replace
    monkeypatch.setattr(os, "replace", replace)
    keeper = ProgressFile(file)
    keeper.keep("a", 1.0, 0.5)
    assert stalled.wait(10.0)
    keeper.keep("a", 2.0, 0.7)  # returns, and is not queued behind the other
    goes_on.set()
    keeper.settle()
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) == (0.5, 0.0)
    keep(keeper, "a", 3.0, 0.9)
    assert ProgressFile(file).recall("a", 3.0, oldest=10.0) == (0.9, 0.0)


def test_digest_tells_paths_apart():
    digests = {path_digest(make_path(name)) for name in "IROS"} | {
        path_digest(make_path("O", end="stop"))
    }
    assert len(digests) == 5
    assert path_digest(make_path("R")) == path_digest(make_path("letter", letter="R"))
