# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a command ends before its end: by an error that it shows as one line, or by Ctrl-C and SIGTERM, which a loop asks for."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Self


class UserError(Exception):
    """Something the user can mend: the text says what came, what was expected and what to do."""


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn the ValueErrors of a core, whose texts are written for the user, into UserErrors."""
    try:
        yield
    except ValueError as error:
        raise UserError(str(error)) from error


SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """While entered, both signals only set `asked`; the handlers before are put back at the end."""

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._ask) for number in SIGNALS}
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _ask(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002
        self.asked = True
