# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether one explanation predicts trials that were left out better than another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

Array = NDArray[np.float64]

# standard errors by which one contender predicts left-out trials better than another
SEPARATE = 2.0


def apart(best: Array, other: Array) -> bool:
    """Whether the best predicts left-out trials (M,) clearly better."""
    return _lead(best, other) > SEPARATE


def tie(best: Array, other: Array) -> float:
    """Weight of a contender against the best one: 1 for equal gains, small for one that predicts worse."""
    return float(2.0 * norm.sf(max(_lead(best, other), 0.0)))


def _lead(best: Array, other: Array) -> float:
    """Mean difference of gains on left-out trials in its standard errors."""
    mean, std = mean_gain(best - other)
    return mean / max(std, 1e-9) if mean else 0.0


def mean_gain(gains: Array) -> tuple[float, float]:
    """Mean of (M,) and its standard error."""
    return float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(len(gains)))
