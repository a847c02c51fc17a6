# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A byte stream that replays recorded bytes, so that device code runs without a port."""

from collections import deque
from collections.abc import Iterable


class RecordedStream:
    """ByteStream: every read returns the next chunk, an exception in the list is raised, writes are kept.

    Reads past the end return nothing, as a silent line does.
    """

    def __init__(self, chunks: Iterable[bytes | Exception] = ()) -> None:
        self.chunks = deque(chunks)
        self.written: list[bytes] = []
        self.closed = False

    def write(self, data: bytes) -> None:
        """Keep data for the test to look at."""
        self.written.append(bytes(data))

    def read(self, timeout_s: float) -> bytes:
        """The next recorded chunk."""
        if not self.chunks:
            return b""
        chunk = self.chunks.popleft()
        if isinstance(chunk, Exception):
            raise chunk
        return chunk

    def close(self) -> None:
        """Note that the port was given back."""
        self.closed = True
