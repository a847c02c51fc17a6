# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A thread that repeats one step at a fixed rate: rclpy timers above 30 Hz are dear on a small computer."""

import threading
import time
from collections.abc import Callable


class Worker:
    """Calls step() every period_s until stop(); calls on_failure() if a step raises."""

    def __init__(
        self, step: Callable[[], None], period_s: float, on_failure: Callable[[], None]
    ) -> None:
        self._step = step
        self._period_s = period_s
        self._on_failure = on_failure
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="device", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Ask for the end and wait for it; a signal may have come before the thread was started."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        due = time.monotonic()
        finished = False
        try:
            while not self._stop.is_set():
                self._step()
                now = time.monotonic()
                due += self._period_s
                if due < now - self._period_s:  # a short delay is made up for, a long one is not
                    due = now
                self._stop.wait(max(due - now, 0.0))
            finished = True
        finally:
            if not finished:
                self._on_failure()
