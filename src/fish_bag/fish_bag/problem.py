# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a recording: one Problem per finding, RecordingError where nothing can be read."""

from __future__ import annotations

from dataclasses import dataclass

from fish_report.errors import UserError

SEVERITIES = ("info", "warning", "error")


class RecordingError(UserError):
    """A recording or data set cannot be used at all; the text says what came and what to do."""


@dataclass(frozen=True)
class Problem:
    """One finding in a trial or data set. The data it speaks of are kept and flagged, never dropped.

    severity: "info" (worth knowing), "warning" (usable with care), "error" (this part is unusable).
    kind: one word to select by, for example "gap", "duplicate", "time_back", "nan", "missing_topic".
    """

    severity: str
    kind: str
    topic: str  # full topic name, "" for the whole trial or data set
    text: str  # what came, what was expected
    count: int = 1  # how many messages or places
    t: float | None = None  # first place, s from trial start

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise ValueError(f"severity {self.severity!r}: expected one of {', '.join(SEVERITIES)}")

    def __str__(self) -> str:
        where = f" {self.topic}" if self.topic else ""
        when = f" (first at {self.t:.3f} s)" if self.t is not None else ""
        return f"{self.severity}: {self.kind}{where}: {self.text}{when}"
