# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks shared by the settings; each error names the field, its value and what is allowed."""

import math


def require_range(name: str, value: float, low: float, high: float) -> None:
    """ValueError unless low <= value <= high (NaN fails)."""
    if not (math.isfinite(value) and low <= value <= high):
        raise ValueError(f"{name} is {value}, expected {low} to {high}")


def require_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    """ValueError unless value is one of choices."""
    if value not in choices:
        raise ValueError(
            f"{name} is {value!r}, expected one of {', '.join(repr(c) for c in choices)}"
        )
