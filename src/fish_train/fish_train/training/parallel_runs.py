# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Several runs side by side, one process each."""

from __future__ import annotations

import multiprocessing
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from typing import Any

from fish_report.worker_pool import worker_pool
from fish_train.training.run import (
    Job,
    Status,
    check_job,
    run,
)

POLL = 0.2  # s between looks at what the processes say
_messages: Any = None  # the queue of a worker process, set when it starts


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
