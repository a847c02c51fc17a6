# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks shared by the path families."""

from __future__ import annotations

import math

from fish_control.reference_path import PathError


def require_positive(family: str, **values: float) -> None:
    """Raise PathError naming the first value that is not a positive finite number."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise PathError(f"{family}: {name} is {value!r}, expected a positive number")
