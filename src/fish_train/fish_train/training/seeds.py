"""Several runs side by side, one process each."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from typing import Any

from fish_train.training.run import Job, Status, run

POLL = 0.2  # s between looks at what the processes say
_messages: Any = None  # the queue of a worker process, set when it starts


def run_all(jobs: Sequence[Job], parallel: int, report: Callable[[Status], None]) -> list[Status]:
    """Run every job, `parallel` at a time; the last status of each, in order."""
    if len(jobs) == 1:
        return [run(jobs[0], report)]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # inherited: one core for each run
    context = multiprocessing.get_context("spawn")
    messages = context.Queue()
    with ProcessPoolExecutor(parallel, context, initializer=_listen, initargs=(messages,)) as pool:
        futures = [pool.submit(_work, job) for job in jobs]
        _forward(messages, futures, report)
        return [future.result() for future in futures]


def _forward(messages: Any, futures: Sequence[Future[Status]], report: Callable[[Status], None]) -> None:
    """Hand on what the workers say until all are done; the first error ends the waiting."""
    while True:
        done = wait(futures, timeout=0.0).done
        try:
            while True:
                report(messages.get(timeout=POLL))
        except queue.Empty:
            pass
        for future in done:
            if error := future.exception():
                for other in futures:
                    other.cancel()
                raise error
        if len(done) == len(futures):
            return


def _listen(messages: Any) -> None:
    global _messages
    _messages = messages


def _work(job: Job) -> Status:
    return run(job, _messages.put)
