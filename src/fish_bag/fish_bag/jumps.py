# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Poses that no fish could have: single camera frames with swapped or lost markers."""

from __future__ import annotations

import numpy as np

NEIGHBOURS = 4  # on each side
POSITION_M, SPEED_M_S = (
    0.10,
    0.6,
)  # allowed distance from the neighbours: so much, and so much per second between
HEADING_RAD, TURN_RAD_S = 0.8, 3.0


def find_jumps(t: np.ndarray, x: np.ndarray, y: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """(N,) bool: pose far from the median of its neighbours in time.

    Sample i jumps if |p_i - median_j p_j| > POSITION + SPEED dt or |median_j wrap(psi_j - psi_i)| > HEADING
    + TURN dt, where j runs over the finite neighbours and dt is their median distance in time. Up to three
    bad frames in a row are found.

    Args:
        t, x, y, psi: (N,) in order of arrival [s, m, m, rad], NaN allowed (never a jump).
    """
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(psi))
    jumps = np.zeros(len(t), bool)
    if len(finite) < 2 * NEIGHBOURS:
        return jumps
    around = np.concatenate([np.arange(-NEIGHBOURS, 0), np.arange(1, NEIGHBOURS + 1)])
    place = np.arange(len(finite))[:, None] + around
    outside = (place < 0) | (place >= len(finite))
    j = finite[np.clip(place, 0, len(finite) - 1)]
    i = finite[:, None]
    dt = _median(np.abs(t[j] - t[i]), outside)
    distance = np.hypot(_median(x[j] - x[i], outside), _median(y[j] - y[i], outside))
    turn = np.abs(_median(np.mod(psi[j] - psi[i] + np.pi, 2 * np.pi) - np.pi, outside))
    jumps[finite] = (distance > POSITION_M + SPEED_M_S * dt) | (
        turn > HEADING_RAD + TURN_RAD_S * dt
    )
    return jumps


def _median(values: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """(N,) median over the neighbours that exist."""
    return np.nanmedian(np.where(outside, np.nan, values), axis=1)
