# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Work on several threads: for what runs outside Python's lock, or waits for other processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
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
