# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Workers end with their pool. They import this module for their tasks: nothing heavy is imported at its top."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

LONG = 30.0  # s, of a task that nobody waits for
_queue = None  # of a worker


@pytest.fixture
def workers():
    """Those that are there; none may be left in the end."""
    before = set(multiprocessing.active_children())

    def workers():
        return set(multiprocessing.active_children()) - before

    yield workers
    for worker in workers():
        assert ends(worker.pid), "a worker outlived its pool"


def ends(process: int) -> bool:
    """Wait for its end. The system is asked: `is_alive` errs for a moment where another thread has reaped the process."""
    deadline = time.monotonic() + 10.0
    while alive(process) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not alive(process)


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def listen(queue) -> None:
    global _queue
    _queue = queue


def flood(place: Path) -> None:
    """The terminal's Ctrl-C, which reaches the workers too; then more to say than a pipe holds, and work to do."""
    place.touch()
    signal.raise_signal(signal.SIGINT)
    for _ in range(64):
        _queue.put("x" * 4096)
    time.sleep(LONG)


def fail_beside_one_that_talks(place: Path) -> None:
    if place.name == "fails":
        raise ZeroDivisionError(place.name)
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        _queue.put("still training")
        time.sleep(0.01)
    place.touch()


def fail_or_work(place: Path) -> None:
    if place.name == "fails":
        raise ZeroDivisionError(place.name)
    time.sleep(LONG)
    place.touch()


def seeds_of(work, monkeypatch: pytest.MonkeyPatch):
    """The module that runs parallel_runs, with light workers."""
    from fish_train.training import parallel_runs

    monkeypatch.setattr(parallel_runs, "_work", work)
    monkeypatch.setattr(parallel_runs, "_listen", listen)
    monkeypatch.setattr(parallel_runs, "check_job", lambda _: None)
    return parallel_runs


def test_ctrl_c_ends_the_seeds_and_begins_none_that_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers
) -> None:
    def report(_) -> None:
        raise KeyboardInterrupt

    jobs = [tmp_path / str(k) for k in range(4)]
    with pytest.raises(KeyboardInterrupt):
        seeds_of(flood, monkeypatch).run_all(jobs, 2, report)
    for worker in workers():
        assert ends(worker.pid), "a worker outlived its pool"
    assert not any(job.exists() for job in jobs[2:])


def test_the_first_error_ends_the_seeds_however_much_the_others_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers
) -> None:
    jobs = [tmp_path / "talks", tmp_path / "fails"]
    with pytest.raises(ZeroDivisionError, match="fails"):
        seeds_of(fail_beside_one_that_talks, monkeypatch).run_all(jobs, 2, lambda _: None)
    assert not (tmp_path / "talks").exists()


def test_the_first_error_ends_a_study(tmp_path: Path, workers) -> None:
    from fish_train.evaluation.study import _in_processes

    places = [tmp_path / name for name in ("fails", "a", "b", "c")]
    with pytest.raises(ZeroDivisionError, match="fails"):
        _in_processes(fail_or_work, [(place,) for place in places], 2)
    assert list(tmp_path.iterdir()) == []


def test_workers_are_prepared_and_gone_when_the_work_is_done(tmp_path: Path, workers) -> None:
    from fish_report.worker_pool import worker_pool

    with worker_pool(1, os.chdir, tmp_path) as pool:
        assert pool.submit(os.getcwd).result() == str(tmp_path)


def test_workers_do_not_outlive_a_killed_owner() -> None:
    owner = """
import os, time
from fish_report.worker_pool import worker_pool
with worker_pool(1) as pool:
    print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 60).result()
"""
    with subprocess.Popen(
        [sys.executable, "-c", owner], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        worker = int(parent.stdout.readline())
        parent.kill()
        parent.wait()
    assert ends(worker)
