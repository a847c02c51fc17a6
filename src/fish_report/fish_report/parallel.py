# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Work on all cores: threads for compiled code, processes for everything else."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0))


def on_all_cores(work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`work` of every item, in their order; the passes of the filter run outside Python's lock."""
    return list(on_threads(work, items, cores()))


def on_threads(
    work: Callable[[Item], Result], items: Iterable[Item], threads: int
) -> Iterator[Result]:
    """`work` of every item on so many threads; results in the order of the items, each as soon as it is there."""
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(work, items)


_endings: list[Callable[[], object]] = []  # of this worker process


@contextmanager
def worker_pool(
    workers: int,
    prepare: Callable[..., object] | None = None,
    *given: object,
    method: str = "spawn",
) -> Iterator[ProcessPoolExecutor]:
    """A pool of `workers`, one core each; prepare(*given) runs in each of them first.

    method: "spawn", or "fork" where the caller may be a script without a guard and no library has started threads yet.
    An error or Ctrl-C in the `with` ends the workers at once, in the midst of what they do, and nothing that waits starts.
    """
    if method == "spawn":
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(name, "1")  # inherited
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context(method)
    pool = ProcessPoolExecutor(workers, context, _begin, (prepare, given))
    try:
        yield pool
    except BaseException:
        own = set(multiprocessing.active_children()) - others
        pool.shutdown(wait=False, cancel_futures=True)
        for (
            worker
        ) in own:  # waiting for them could take hours, or for ever where nobody reads what they say
            worker.terminate()
        raise
    pool.shutdown()


def at_end_of_worker(work: Callable[[], object]) -> None:
    """In a worker, from `prepare`: do this too when the pool ends the worker or the pool's process is gone.

    For what the worker has started itself, such as a process that it waits for.
    """
    _endings.append(work)
    signal.signal(signal.SIGTERM, _end)


def _end(_signal: int = 0, _frame: FrameType | None = None) -> None:
    for work in _endings:
        work()
    os._exit(1)


def _begin(prepare: Callable[..., object] | None, given: tuple[object, ...]) -> None:
    """In a worker: Ctrl-C, which reaches all of them, is for the pool's process to answer, whose end is theirs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a forked worker has its owner's handler
    owner = multiprocessing.parent_process()
    assert owner is not None  # this is a worker

    def watch() -> None:
        owner.join()
        _end()

    threading.Thread(target=watch, daemon=True).start()
    if prepare is not None:
        prepare(*given)
