# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a second node publishes what only one may: two of them pull the fish to and fro, and nothing fails."""

import time
from collections.abc import Callable

PATIENCE_S = 2.0  # s, one node may take the place of another


class Rivals:
    """Watches the number of publishers of a topic.

    Args:
        topic: full name.
        count: gives the publishers of a topic, the node's own among them.
        warn: called once with a message for each rival.
        now: clock [s].
    """

    def __init__(
        self,
        topic: str,
        count: Callable[[str], int],
        warn: Callable[[str], object],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._topic, self._count, self._warn, self._now = topic, count, warn, now
        self._since: float | None = None
        self._warned = False

    def warning(self) -> str:
        """What to warn of; empty while the node is alone. To be asked once a second or so."""
        now = self._now()
        if self._count(self._topic) <= 1:
            self._since, self._warned = None, False
        elif self._since is None:
            self._since = now
        if self._since is None or now - self._since < PATIENCE_S:
            return ""
        text = f"another publisher of {self._topic}: stop one of the two"
        if not self._warned:
            self._warned = True
            self._warn(text)
        return text
