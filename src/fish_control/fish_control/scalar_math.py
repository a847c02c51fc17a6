# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The functions that the control law asks of `xp`, for plain numbers: numpy takes ten times as long for one number."""

from __future__ import annotations

from math import atan2 as arctan2
from math import cos, hypot, sin, sqrt

__all__ = ["arctan2", "cos", "fmax", "fmin", "hypot", "sin", "sqrt"]


def fmin(a: float, b: float) -> float:
    """The smaller one; the other one where one is no number."""
    return a if a <= b or b != b else b


def fmax(a: float, b: float) -> float:
    """The larger one; the other one where one is no number."""
    return a if a >= b or b != b else b
