# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records of one motion compared with each other: common variation, unit, common time grid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fish_bag.problem import Problem

Array = NDArray[np.float64]

FEWEST = 50  # samples of a record that is compared
FOLLOWS = 0.9  # correlation from which one record follows the other
STRAYS = 0.5  # correlation below which it does not
SLOPES = (0.6, 1.6)  # of records in the same unit; a sensor of the real world is a few per cent off
UNITS = {57.3: "deg", 9.549: "rpm", 0.1592: "revolutions", 1000.0: "thousandths"}
LENGTHS = {3.281: "feet", 39.37: "inches", 100.0: "cm", 1000.0: "mm"}
GRID_S = 0.01  # step of the common time grid


def unit_problem(
    kind: str,
    topic: str,
    text: str,
    unit: str,
    slope: float,
    known: dict[float, str] | None = None,
) -> Iterator[Problem]:
    """An error where a slope lies far from 1, with the unit that it looks like.

    Args:
        text: what was compared; {} is the place of the slope.
        unit: the expected one.
        known: factor -> name of the units that come to mind.
    """
    if SLOPES[0] < slope < SLOPES[1]:
        return
    close = [
        name
        for factor, name in (known or UNITS).items()
        if 0.8 < slope / factor < 1.25 or 0.8 < slope * factor < 1.25
    ]
    guess = f" ({close[0]}?)" if close else ""
    remedy = f"expected {unit}: multiply by {1 / slope:.3g} where it is published"
    yield Problem("error", kind, topic, f"{text.format(f'{slope:.3g}')}{guess}; {remedy}")


def correlation(a: Array, b: Array) -> float:
    """Of two records (N,), 0 where one does not vary."""
    return float(np.corrcoef(a, b)[0, 1]) if np.std(a) and np.std(b) else 0.0


def integral(t: Array, values: Array) -> Array:
    """(N,) integral from the first sample on, trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])


def without_trend(t: Array, values: Array) -> Array:
    """Values (N,) without their straight line: a gyro's bias makes one in its integral."""
    base = np.column_stack([np.ones(len(t)), t - t.mean()])
    return np.asarray(values - base @ np.linalg.lstsq(base, values, rcond=None)[0])


def common_grid(*times: Array) -> Array:
    """(T,) times in steps of GRID_S that all records cover [s]; empty where they do not overlap."""
    start, end = max(t[0] for t in times), min(t[-1] for t in times)
    return np.asarray(start + GRID_S * np.arange(max(0, int((end - start) / GRID_S))))
