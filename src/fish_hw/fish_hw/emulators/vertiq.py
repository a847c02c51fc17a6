# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A VertiqModule behind a pseudo-terminal: the real driver talks to it through a real port.

A module waits for nobody: replies that nobody takes are lost.
"""

import contextlib
import os
import pty
import select
import termios
import threading
import time
import tty
from collections.abc import Callable

from fish_hw.emulators.vertiq_module import VELOCITY_MODE, VertiqModule

POLL_S = 0.02
OUTPUT_SPEED = 5  # index in termios.tcgetattr
NOISE = b"\xf8\x00\xfe"  # what bytes at another speed look like

__all__ = ["VELOCITY_MODE", "VertiqEmulator"]


class VertiqEmulator(VertiqModule):
    """Runs on its own thread until close(); `port` is what the driver opens.

    Args:
        module: module id it answers to.
        lag_s: time constant of the rotor.
        speed: speed constant of termios that it runs at; a port that is set to another one reads noise. None: any.
        clock: s, by which the rotor turns.
    """

    def __init__(
        self,
        module: int = 0,
        lag_s: float = 0.01,
        speed: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._speed = speed
        super().__init__(module, lag_s, clock)
        self._moving = threading.RLock()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and take the port away, as pulling the plug does; may be called twice."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def move(self) -> None:
        """As VertiqModule's; any thread may ask."""
        with self._moving:
            super().move()

    def _understands(self) -> bool:
        return self._speed is None or termios.tcgetattr(self._master)[OUTPUT_SPEED] == self._speed

    def _run(self) -> None:
        while not self._stop.is_set():
            readable, _, _ = select.select([self._master], [], [], POLL_S)
            self.move()
            if readable:
                data = os.read(self._master, 512)
                with self._moving:
                    replies = self.feed(data) if self._understands() else NOISE
                with contextlib.suppress(BlockingIOError):
                    os.write(self._master, replies)
