# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Linear Kalman filters side by side, one for each candidate model, and how well each predicts what is measured.

The score of a candidate is the sum of the log densities that it gave to the measurements before it knew them, less
that of the best one; older ones fade. With the prior it gives the candidate's share. Sources: Magill, Optimal adaptive
estimation of sampled stochastic processes, 1965; Dawid, Prequential approach, 1984.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MEMORY = 30.0  # s of measurements, of the scores
WILD = 25.0  # squared Mahalanobis distances count no more: one wrong pose decides nothing


class FilterBank:
    """K filters with n states each; a measurement is of the first m of them, 1 or 2, z = x[:m] + noise of covariance R.

    Args:
        log_prior: (K,) logarithms of the candidates' shares before the first measurement, up to a constant.
    """

    def __init__(self, log_prior: Array) -> None:
        self._log_prior, self._scores = log_prior, np.zeros(len(log_prior))
        self.x, self.P = np.zeros((len(log_prior), 0)), np.zeros((len(log_prior), 0, 0))

    def start(self, x: Array, P: Array) -> None:
        """Put all filters at one state (n,) with its covariance (n, n); the scores remain."""
        K = len(self._log_prior)
        self.x, self.P = np.tile(x, (K, 1)), np.tile(P, (K, 1, 1))

    def predict(self, F: Array, u: Array, Q: Array) -> None:
        """Move by x = F x + u with the noise Q: (K, n, n), (K, n), (K, n, n)."""
        self.x = _times(F, self.x) + u
        self.P = F @ self.P @ F.swapaxes(1, 2) + Q

    def correct(self, z: Array, R: Array, dt: float, scored: bool) -> None:
        """Take in a measurement (m,) with covariance R (m, m), dt [s] after the last; scored: it counts for the shares."""
        m = len(z)
        inverse, determinant = _inverse(self.P[:, :m, :m] + R)
        y = z - self.x[:, :m]
        if scored:
            square = (y * _times(inverse, y)).sum(axis=1)
            score = -0.5 * (np.minimum(square, WILD) + np.log(determinant))
            self._scores = math.exp(-dt / MEMORY) * self._scores + score - score.max()
        gain = self.P[:, :, :m] @ inverse
        keep = np.zeros(self.P.shape)
        keep[:, :, :m] = -gain
        keep += np.eye(self.P.shape[1])
        self.x = self.x + _times(gain, y)
        self.P = keep @ self.P @ keep.swapaxes(1, 2) + gain @ R @ gain.swapaxes(1, 2)

    @property
    def shares(self) -> Array:
        """(K,) of the candidates, their sum is 1."""
        log = self._scores + self._log_prior
        weights = np.exp(log - log.max())
        shares: Array = weights / weights.sum()
        return shares


def _times(matrices: Array, vectors: Array) -> Array:
    """Products (K, n) of matrices (K, n, m) and vectors (K, m)."""
    product: Array = (matrices @ vectors[:, :, None])[:, :, 0]
    return product


def _inverse(matrices: Array) -> tuple[Array, Array]:
    """Inverses (K, m, m) and determinants (K,) of symmetric matrices (K, m, m), m 1 or 2, by their cofactors."""
    if matrices.shape[1] == 1:
        return 1.0 / matrices, matrices[:, 0, 0]
    a, b, c = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinant = a * c - b * b
    return np.array(((c, -b), (-b, a))).transpose(2, 0, 1) / determinant[:, None, None], determinant
