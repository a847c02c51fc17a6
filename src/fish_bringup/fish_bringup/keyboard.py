# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keys of a terminal, one at a time and without waiting; the terminal is given back as it was."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from fish_report.errors import UserError

ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}


class Keyboard:
    """Reads a terminal by its file descriptor."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal

    def key(self) -> str | None:
        """`up`, `down`, `left`, `right`, or the character; None if no key was pressed."""
        if not select.select([self._terminal], [], [], 0.0)[0]:
            return None
        pressed = os.read(self._terminal, 64)
        return ARROWS.get(pressed[-3:], pressed[-1:].decode("latin-1"))


@contextmanager
def keyboard() -> Iterator[Keyboard | None]:
    """The terminal of standard input, single keys; None where it is no terminal.

    Raises:
        UserError: the terminal cannot be set.
    """
    if not sys.stdin.isatty():
        yield None
        return
    terminal = sys.stdin.fileno()
    try:
        before = termios.tcgetattr(terminal)
        tty.setcbreak(terminal)
    except termios.error as error:
        raise UserError(f"the terminal gives no single keys: {error}") from error
    try:
        yield Keyboard(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
