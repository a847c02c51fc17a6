# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner's progress on disk, so that a planner that was killed goes on where it was.

Odometry alone cannot say where on a self-crossing path the robot is, and topics of a killed publisher are gone.
The file is removed when the planner ends as it should, and when a path is sent again that was swum to its end. After an
error it stays: whoever starts the planner again wants it to go on.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from fish_control.reference_path import ReferencePath

SAVE_PERIOD = 0.2  # s between writes


def path_digest(path: ReferencePath) -> str:
    """Same for the same points, to a millimetre, and the same end."""
    content = (path.points * 1000.0).round().astype(
        "int64"
    ).tobytes() + f"{path.closed} {path.end}".encode()
    return hashlib.sha256(content).hexdigest()[:16]


class ProgressFile:
    """Keeps the progress along one path at a time.

    A thread of its own writes, because a write to a busy disk can take half a second.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._next_save = -math.inf
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="progress")
        self._writing: Future[None] | None = None
        self._forgotten = False  # though the file may still be there
        self.problem = ""  # why it could not be written, if so

    def recall(self, digest: str, time: float, oldest: float) -> tuple[float, float] | None:
        """(progress [m], age [s]) that was kept for this path within `oldest` [s] before `time` [s].

        None if there is none: no file, a damaged one, another path, too old, or from a clock that was ahead.
        """
        if self._forgotten:
            return None
        try:
            data = json.loads(self._file.read_text(encoding="utf-8"))
            known, kept, progress = str(data["path"]), float(data["time"]), float(data["progress"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if known != digest or not 0.0 <= time - kept <= oldest or not 0.0 <= progress < math.inf:
            return None
        return progress, time - kept

    def keep(self, digest: str, time: float, progress: float) -> None:
        """Have it written, at most every SAVE_PERIOD of `time` [s] and not while the disk still writes the last."""
        if (
            self._next_save - 10.0 * SAVE_PERIOD < time < self._next_save
        ):  # a clock set back writes at once
            return
        if self._writing is not None and not self._writing.done():
            return
        self._next_save, self._forgotten = time + SAVE_PERIOD, False
        content = json.dumps({"path": digest, "time": time, "progress": progress})
        self._writing = self._writer.submit(self._replace, content)

    def settle(self) -> None:
        """Wait until the disk is done with what was asked of it last."""
        if self._writing is not None:
            self._writing.result()

    def forget(self) -> None:
        """Have the file removed, after what is being written."""
        self._forgotten = True
        self._writing = self._writer.submit(self._remove)

    def _replace(self, content: str) -> None:
        """In one step: a reader finds the old or the new content."""
        new = self._file.with_name(self._file.name + ".new")
        try:
            new.write_text(content, encoding="utf-8")
            os.replace(new, self._file)
            self.problem = ""
        except OSError as error:
            self.problem = f"progress cannot be kept in {self._file}: {error.strerror}"

    def _remove(self) -> None:
        try:
            self._file.unlink(missing_ok=True)
        except OSError as error:
            self.problem = f"progress cannot be removed from {self._file}: {error.strerror}"
