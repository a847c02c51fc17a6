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
    """K filters with n states each; a measurement is of the first m of them, z = x[:m] + noise of covariance R.

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
        self.x = np.einsum("kij,kj->ki", F, self.x) + u
        self.P = F @ self.P @ F.swapaxes(1, 2) + Q

    def correct(self, z: Array, R: Array, dt: float, scored: bool) -> None:
        """Take in a measurement (m,) with covariance R (m, m), dt [s] after the last; scored: it counts for the shares."""
        m = len(z)
        S = self.P[:, :m, :m] + R
        inverse, y = np.linalg.inv(S), z - self.x[:, :m]
        if scored:
            square = np.einsum("ki,kij,kj->k", y, inverse, y)
            score = -0.5 * (np.minimum(square, WILD) + np.log(np.linalg.det(S)))
            self._scores = math.exp(-dt / MEMORY) * self._scores + score - score.max()
        gain = self.P[:, :, :m] @ inverse
        keep = np.eye(self.P.shape[1]) - gain @ np.eye(m, self.P.shape[1])
        self.x = self.x + np.einsum("kij,kj->ki", gain, y)
        self.P = keep @ self.P @ keep.swapaxes(1, 2) + gain @ R @ gain.swapaxes(1, 2)

    @property
    def shares(self) -> Array:
        """(K,) of the candidates, their sum is 1."""
        log = self._scores + self._log_prior
        weights = np.exp(log - log.max())
        shares: Array = weights / weights.sum()
        return shares
