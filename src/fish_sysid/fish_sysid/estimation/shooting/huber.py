# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Huber's function: quadratic up to ROBUST, linear beyond."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROBUST = 3.0  # scaled errors beyond it count linearly


def huber(e: Array) -> Array:
    """Cost of scaled errors."""
    size = np.abs(e)
    return np.where(size < ROBUST, 0.5 * e**2, ROBUST * size - 0.5 * ROBUST**2)


def weight(e: Array) -> Array:
    """Weights with which a quadratic cost has the same gradient."""
    return np.minimum(1.0, ROBUST / np.maximum(np.abs(e), 1e-9))
