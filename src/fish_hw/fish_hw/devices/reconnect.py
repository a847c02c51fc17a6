"""When to try a lost device again."""

FIRST_WAIT_S = 0.5
LONGEST_WAIT_S = 5.0


class Backoff:
    """Doubling waits between attempts, from FIRST_WAIT_S to LONGEST_WAIT_S."""

    def __init__(self) -> None:
        self.attempts = 0
        self._next = 0.0
        self._wait = FIRST_WAIT_S

    def due(self, now: float) -> bool:
        """Whether the next attempt may be made."""
        return now >= self._next

    def failed(self, now: float) -> None:
        """An attempt failed, or the device was lost."""
        self.attempts += 1
        self._next = now + self._wait
        self._wait = min(2 * self._wait, LONGEST_WAIT_S)

    def succeeded(self) -> None:
        """The device works."""
        self._wait = FIRST_WAIT_S
