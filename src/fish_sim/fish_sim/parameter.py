# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One number of a model with its unit, admissible range and source."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """A named quantity's default, unit, admissible range and where the numbers come from."""

    value: float
    unit: str
    lowest: float
    highest: float
    source: str = ""
    typical: float | None = (
        None  # a plausible non-zero strength: where searches start and tests probe
    )
    # values that a search starts from, where it cannot walk from one to the next: a frequency, a place, a limit
    tries: tuple[float, ...] = ()
