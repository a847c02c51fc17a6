# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Why a module does not answer: another id, another baud rate, another firmware, or nobody there."""

import time
from collections.abc import Callable

from fish_hw.devices.vertiq import Vertiq
from fish_hw.protocol import iquart
from fish_hw.transport.interfaces import ByteStream, TransportError

BAUDS = (9600, 57600, 115200, 230400, 460800, 921600, 1_000_000, 2_000_000)
IDS = range(64)
ANSWER_S = 0.01  # s to wait for each answer
TRIES = 2


def explain(
    open_at: Callable[[int], ByteStream],
    baud: int,
    module_id: int,
    clock: Callable[[], float] = time.monotonic,
) -> str:
    """What is there instead of a module `module_id` with speed firmware at `baud`, in words; empty if nothing answers.

    Only questions are sent. It takes about a second.
    """
    try:
        stream = open_at(baud)
        try:
            if _answers_in_time(stream, module_id, clock):
                return (
                    f"module {module_id} answers, but has no register for the speed command: it needs the speed firmware, "
                    "not that of a servo"
                )
            found = [
                other for other in IDS if other != module_id and _answers(stream, other, clock)
            ]
        finally:
            stream.close()
        if found:
            ids = ", ".join(map(str, found))
            return f"module {ids} answers there: set module_id, or the module's own id"
        for other in BAUDS:
            if other != baud and _answers_at(open_at, other, module_id, clock):
                return f"module {module_id} answers at {other} baud: set baud, or the module's own rate"
    except TransportError:  # the port says it by itself at the next attempt
        return ""
    return ""


def _answers_at(
    open_at: Callable[[int], ByteStream], baud: int, module_id: int, clock: Callable[[], float]
) -> bool:
    stream = open_at(baud)
    try:
        return _answers_in_time(stream, module_id, clock)
    finally:
        stream.close()


def _answers_in_time(stream: ByteStream, module_id: int, clock: Callable[[], float]) -> bool:
    """Asked TRIES times: one answer may be lost."""
    return any(_answers(stream, module_id, clock) for _ in range(TRIES))


def _answers(stream: ByteStream, module_id: int, clock: Callable[[], float]) -> bool:
    (version,) = Vertiq(stream, module_id, 1, ANSWER_S, clock).read(iquart.FIRMWARE)
    return version is not None
