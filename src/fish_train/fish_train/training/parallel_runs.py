# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Several runs side by side, one process each, and what is shown of them: a live table on a terminal, lines elsewhere."""

from __future__ import annotations

import multiprocessing
import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

from fish_report.parallel import worker_pool
from fish_report.terminal import say
from fish_train.training.run import (
    Job,
    Status,
    check_job,
    run,
)

POLL = 0.2  # s between looks at what the processes say
_messages: Any = None  # the queue of a worker process, set when it starts
LINE_PERIOD = 10.0  # s between lines of a run where there is no terminal
BAR = 12  # characters of the bar of levels


def run_all(jobs: Sequence[Job], parallel: int, report: Callable[[Status], None]) -> list[Status]:
    """Run every job, `parallel` at a time; the last status of each, in order. The first error or Ctrl-C ends them all."""
    if len(jobs) == 1:
        return [run(jobs[0], report)]
    for job in jobs:  # what is refused is refused before any of them has begun
        check_job(job)
    messages = multiprocessing.get_context("spawn").Queue()
    with worker_pool(parallel, _listen, messages) as pool:
        futures = [pool.submit(_work, job) for job in jobs]
        _forward(messages, futures, report)
        return [future.result() for future in futures]


def _forward(
    messages: Any, futures: Sequence[Future[Status]], report: Callable[[Status], None]
) -> None:
    """Hand on what the workers say until all are done; the first error ends the waiting."""
    while True:
        done = wait(futures, timeout=0.0).done
        for future in done:
            if error := future.exception():
                raise error
        try:
            report(messages.get(timeout=POLL))
        except queue.Empty:
            if len(done) == len(futures):
                return


def _listen(messages: Any) -> None:
    global _messages
    _messages = messages


def _work(job: Job) -> Status:
    return run(job, _messages.put)


class Display:
    """Shows the newest status of every run; a context manager, called with statuses."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._statuses: dict[int, Status] = {}
        self._printed: dict[int, float] = {}
        self._live = Live(console=console, refresh_per_second=4) if console.is_terminal else None

    def __call__(self, status: Status) -> None:
        self._statuses[status.seed] = status
        if self._live is not None:
            self._live.update(self._table())
        elif status.state != "training" or self._due(status.seed):
            say(self._console, line(status))
        if status.message:
            say(self._console, f"seed {status.seed}: {status.message}")

    def _due(self, seed: int) -> bool:
        now = time.monotonic()
        if now - self._printed.get(seed, -LINE_PERIOD) < LINE_PERIOD:
            return False
        self._printed[seed] = now
        return True

    def _table(self) -> Table:
        table = Table(box=None, pad_edge=False)
        for name in (
            "seed",
            "level",
            "",
            "update",
            "steps/s",
            "time",
            "cost",
            "cross-track",
            "window",
            "heading",
            "speed",
            "state",
        ):
            table.add_column(
                name, justify="left" if name in ("", "state") else "right", no_wrap=True
            )
        for _, status in sorted(self._statuses.items()):
            table.add_row(*cells(status))
        return table

    def __enter__(self) -> Display:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()


def cells(status: Status) -> list[str]:
    """The row of a run; errors in mm, mrad and mm/s."""
    p = status.progress
    if p is None:
        return [
            str(status.seed),
            "",
            "",
            "",
            "",
            f"{status.seconds:.0f} s",
            "",
            "",
            "",
            "",
            "",
            status.state,
        ]
    full = round(BAR * p.level / status.levels)
    return [
        str(status.seed),
        f"{p.level}/{status.levels}",
        "█" * full + "░" * (BAR - full) + f" {p.name}",
        str(p.update),
        f"{status.rate:.0f}",
        f"{status.seconds:.0f} s",
        f"{p.cost:.4f}",
        f"{1e3 * p.cross_track:.1f} mm",
        f"{1e3 * p.criterion:.1f} mm",
        f"{1e3 * p.heading:.0f} mrad",
        f"{1e3 * p.speed:.1f} mm/s",
        status.state,
    ]


def line(status: Status) -> str:
    """The same for a log."""
    p = status.progress
    if p is None:
        return f"seed {status.seed}: {status.state}, {status.seconds:.0f} s"
    errors = (
        f"cross-track {1e3 * p.cross_track:.1f} mm (window {1e3 * p.criterion:.1f}), "
        f"heading {1e3 * p.heading:.0f} mrad, speed {1e3 * p.speed:.1f} mm/s"
    )
    return (
        f"seed {status.seed}: {status.state}, {status.seconds:.0f} s, level {p.level}/{status.levels} ({p.name}), "
        f"update {p.update}, {status.rate:.0f} env steps/s, cost {p.cost:.4f}, {errors}"
    )
