# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Worker processes: what they return, and what is left of them when their work goes wrong."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from fish_report.worker_pool import at_end_of_worker, worker_pool

_started: list[subprocess.Popen[bytes]] = []


def kill_what_was_started() -> None:
    at_end_of_worker(lambda: [process.kill() for process in _started])


def comes_true(condition: Callable[[], object], patience: float = 120.0) -> bool:
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


def has_ended(pid: int) -> bool:
    """No such process, or one that nobody has waited for yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def square(number: int) -> int:
    return number * number


def wait_for_a_process(note: str) -> None:
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]) as process:
        _started.append(process)
        Path(note).write_text(str(process.pid))
        process.wait()


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_work_is_done_in_other_processes(method: str) -> None:
    with worker_pool(2, method=method) as pool:
        assert list(pool.map(square, range(4))) == [0, 1, 4, 9]
        assert pool.submit(os.getpid).result() != os.getpid()


def test_an_error_ends_the_workers_and_what_they_have_started(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    with (
        pytest.raises(ValueError, match="given up"),
        worker_pool(1, kill_what_was_started) as pool,
    ):
        pool.submit(wait_for_a_process, str(note))
        assert comes_true(lambda: note.exists() and note.read_text())
        raise ValueError("given up")
    assert comes_true(lambda: has_ended(int(note.read_text())))
