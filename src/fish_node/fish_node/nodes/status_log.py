# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""On the console too, what a node says of itself on /diagnostics: nobody sees that without `ros2 topic echo`."""

import re
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

QUIET_S = 30.0  # s
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")


class StatusLog:
    """One line for each change of level or words; other numbers in the same words are no change.

    What was said is not said again for QUIET_S, then only if it holds: one that comes and goes fills no log.

    Args:
        logger: of the node.
        now: clock [s].
    """

    def __init__(self, logger: Any, now: Callable[[], float] = time.monotonic) -> None:
        self._logger, self._now = logger, now
        self._last: tuple[bytes, str] | None = None
        self._said: dict[tuple[bytes, str], float] = {}  # when

    def say(self, level: bytes, message: str) -> None:
        """Take the node's status; it may be the same again and again."""
        now, status = self._now(), (level, NUMBER.sub("#", message))
        self._said = {known: when for known, when in self._said.items() if now - when < QUIET_S}
        if status == self._last or status in self._said:
            return
        self._last, self._said[status] = status, now
        if level == DiagnosticStatus.OK:
            self._logger.info(message)
        elif level == DiagnosticStatus.WARN:
            self._logger.warning(message)
        else:
            self._logger.error(message)
