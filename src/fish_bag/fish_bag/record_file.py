# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A file that only ever holds whole records: what is appended is on disk entirely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from fish_bag.problem import RecordingError

RESERVE_BYTES = 128 * 1024  # given back when the disk is full, to end the file with
RESERVE_NAME = ".reserve"


class DiskFullError(RecordingError):
    """Nothing more can be written; what was written before is kept."""


class RecordFile:
    """An output stream of the mcap package without a buffer: a killed process loses nothing that was written."""

    def __init__(self, path: Path) -> None:
        """Create the file, which must not exist yet, and a reserve file in the same folder.

        Raises:
            DiskFullError: there is no room for either.
        """
        self.path, self.size = path, 0
        self._reserve = path.parent / RESERVE_NAME
        try:
            self._reserve.write_bytes(bytes(RESERVE_BYTES))
            self._raw = path.open("xb", buffering=0)
        except OSError as error:
            self.release_reserve()
            raise DiskFullError(f"{path}: no room for a recording: {error.strerror}") from error

    def write(self, data: bytes) -> int:
        """Append all of `data` and return its length.

        Raises:
            DiskFullError: it could not be written; the file is as it was before.
        """
        view = memoryview(data)
        try:
            while view:
                view = view[self._raw.write(view) :]
        except OSError as error:
            self.cut(self.size)
            kept = f"{self.size} bytes written before are kept"
            raise DiskFullError(f"{self.path}: writing failed: {error.strerror}; {kept}") from error
        self.size += len(data)
        return len(data)

    def cut(self, size: int) -> None:
        """Drop everything after `size` bytes."""
        self._raw.truncate(size)
        self._raw.seek(size)
        self.size = size

    def tell(self) -> int:
        """Bytes written so far."""
        return self.size

    def flush(self) -> None:
        """Do nothing: every write goes to the operating system at once."""

    def release_reserve(self) -> None:
        """Give the reserve's room back to the disk."""
        self._reserve.unlink(missing_ok=True)

    def close(self) -> None:
        """Wait until everything has reached the disk."""
        self.release_reserve()
        os.fsync(self._raw.fileno())
        self._raw.close()
