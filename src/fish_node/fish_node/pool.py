# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's walls: origin at the centre, x along the first side.

FISH_POOL=LENGTHxWIDTH [m] in the environment sets those of another pool, for every node and command that has the variable.
"""

from __future__ import annotations

import os

FARTHEST = 1e3  # m, along x or y from the origin; a position beyond it is wrong in any pool
MEASURED = "4.27x2.13"  # m, of the published robot's pool


def pool_sides(text: str) -> tuple[float, float]:
    """Sides (length, width) [m] of LENGTHxWIDTH; ValueError unless both are 0.1 to 100."""
    try:
        length, width = (float(side) for side in text.lower().split("x"))
    except ValueError:
        length = width = 0.0
    if not (0.1 <= length <= 100.0 and 0.1 <= width <= 100.0):
        raise ValueError(f"{text}: expected sides in metres, 0.1 to 100, like {MEASURED}")
    return length, width


def _walls() -> tuple[float, float]:
    """Of the environment. One line ends a program that would take other walls than the pool's."""
    try:
        return pool_sides(os.environ.get("FISH_POOL", MEASURED))
    except ValueError as error:
        raise SystemExit(f"FISH_POOL={error}") from error


LENGTH, WIDTH = _walls()  # m, along x and along y
