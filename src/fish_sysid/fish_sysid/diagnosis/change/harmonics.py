# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Amplitudes of IMU signals at the rotor's stroke, relative to the phase of its command.

In a window of weights w about a centre, with the phase phi of the command's analytic signal,

    H_k = 2 sum of w (x - mean) exp(-i k phi) / sum of w

A fish that is mirror-symmetric and swims straight turns and slips at the stroke itself, and surges at twice it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert
from scipy.sparse import csr_matrix

from fish_sim.model import DT

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

HALF_WIDTH = 1.0  # s, of a window: four strokes at 2 Hz
LEAST_SPEED = 1.0  # rad/s of the rotor; a slower one has no phase
# signal and multiple of the stroke
HARMONICS = (("gyro", 1), ("left", 1), ("ahead", 1), ("ahead", 2))


@dataclass(frozen=True)
class StrokeWeights:
    """Weights of a signal on the grid (T,) for C centres."""

    by_multiple: Mapping[int, csr_matrix]  # (C, T) complex
    rotor: Array  # (C,) rad/s, amplitude of the commanded speed
    stroke: Array  # (C,) rad/s

    @classmethod
    def of(cls, rotor: Array, centres: Array) -> StrokeWeights:
        """For the commanded speed (T,) of the rotor and centres (C,) [s]."""
        driven = np.asarray(hilbert(rotor - rotor.mean()))
        size, phase = np.abs(driven), np.unwrap(np.angle(driven))
        plain = _windows(centres, size > LEAST_SPEED)
        by_multiple = {}
        for k in {multiple for _, multiple in HARMONICS}:
            turned = np.exp(-1j * k * phase)
            mean = np.asarray(plain @ turned)
            by_multiple[k] = 2.0 * (plain.multiply(turned) - plain.multiply(mean[:, None])).tocsr()
        return cls(by_multiple, plain @ size, plain @ np.gradient(phase, DT))

    def amplitudes(self, gyro: Array, ahead: Array, left: Array) -> Complex:
        """(C, 4) of HARMONICS of signals (T,) without gaps."""
        values = {"gyro": gyro, "ahead": ahead, "left": left}
        return np.column_stack([self.by_multiple[k] @ values[name] for name, k in HARMONICS])


def _windows(centres: Array, turning: NDArray[np.bool_]) -> csr_matrix:
    """Normalised Hann windows (C, T) over the grid points where the rotor turns."""
    rows, columns, values = [], [], []
    for i, centre in enumerate(centres):
        first, last = (round((centre + side * HALF_WIDTH) / DT) for side in (-1.0, 1.0))
        k = np.arange(max(first, 0), min(last + 1, len(turning)))
        w = np.cos(0.5 * np.pi * (DT * k - centre) / HALF_WIDTH) ** 2 * turning[k]
        rows.append(np.full(len(k), i))
        columns.append(k)
        values.append(w / max(float(w.sum()), 1e-9))
    at = np.concatenate(rows), np.concatenate(columns)
    return csr_matrix((np.concatenate(values), at), shape=(len(centres), len(turning)))
