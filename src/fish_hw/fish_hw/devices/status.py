# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a device says about itself, for diagnostics."""

from dataclasses import dataclass, field

OK, WARN, ERROR = 0, 1, 2  # as in diagnostic_msgs/DiagnosticStatus


@dataclass(frozen=True)
class Status:
    """Level, one line, and named values."""

    level: int
    message: str
    values: dict[str, object] = field(default_factory=dict)
