# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which model of the motion the poses bear out: how noisy the IMU is, and whether its accelerometer helps at all.

Candidates of the position, with white noise w of density q in m^2/s^3 each:

    accelerometer used:      p' = v,   v' = R(psi) (a - b) + w
    accelerometer not used:  p' = v,   v' = w

A head that rolls as it swings leaks gravity into its accelerometer; where that is more than the head's own
acceleration, the second model predicts better. Candidates of the heading: psi' = w_imu - b_g, with the variance of each
turn multiplied by a factor. A bank of linear Kalman filters with one candidate each follows the poses. The score of a
candidate is the sum of the log densities that it gave to the measurements before it knew them, less that of the best one;
older ones fade. With the prior it gives the candidate's share, and the shares choose the model and its noise. The mean of a noise
over its candidates is cautious while the poses leave much open, since the largest ones weigh most.
Sources: Magill, Optimal adaptive estimation of sampled stochastic processes, 1965; Dawid, Prequential approach, 1984.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion_config import MotionNoise
from fish_control.imu_heading import SAMPLE_PERIOD
from fish_control.imu_history import ImuHistory, Step
from fish_control.measurement_buffer import Moment
from fish_control.strapdown import MotionModel, NoiseScale, Preintegration

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


ACCEL_FACTORS = 2.0 ** np.arange(0.0, 6.1, 0.5)  # on the accelerometer's standard deviation
DENSITIES = 10.0 ** np.arange(-4.0, -0.9, 0.5)  # m^2/s^3, of the acceleration that nobody measures
TURN_FACTORS = 4.0 ** np.arange(0.0, 5.1, 0.5)  # on the variance of the heading's turns
LONGEST_GAP = 0.5  # s between two poses that are compared
POSITION = np.array([0, 1, 3, 4, 6, 7])  # place, velocity and biases in the strapdown state
HEADING = np.array([2, 5])  # heading and bias
POSITION_BLOCK, HEADING_BLOCK = np.ix_(POSITION, POSITION), np.ix_(HEADING, HEADING)


class MotionModels:
    """Feed it the moments of a timeline; ask for the model."""

    def __init__(self, noise: MotionNoise, scale: NoiseScale) -> None:
        self._noise, self._scale = noise, scale
        known = noise.accel_noise**2 * SAMPLE_PERIOD * ACCEL_FACTORS**2
        self._density = np.concatenate((known, DENSITIES))
        self._measuring = len(known)  # candidates that use the accelerometer; the others follow
        self._used = np.arange(len(self._density)) < len(known)
        sizes = np.where(self._used, len(known), len(DENSITIES))
        self._position = FilterBank(-np.log(sizes))
        self._heading = FilterBank(-np.log(TURN_FACTORS))
        self._time = -math.inf  # s, of the moment that was followed last
        self._fresh = True  # whether the banks begin anew at the next moment
        self.current = self._choose()

    @property
    def time(self) -> float:
        """Up to which the poses are followed [s]."""
        return self._time

    def begin(self, time: float = -math.inf) -> None:
        """Go on with the moments after `time` [s] of another timeline; what was learned remains."""
        self._time, self._fresh = time, True

    def follow(self, moments: Sequence[Moment], imu: ImuHistory, scored: bool) -> MotionModel:
        """Take in moments in a row, as far as the IMU has measured; scored: they count for the choice, which is returned."""
        for before, after in pairwise(moments):
            if after.time > imu.last_time:
                break
            if self._fresh or before.time != self._time:
                self._position.start(before.x[POSITION], before.P[POSITION_BLOCK])
                self._heading.start(before.x[HEADING], before.P[HEADING_BLOCK])
            self._compare(before, after, imu.between(before.time, after.time), scored)
            self._time = after.time
        self.current = self._choose()
        return self.current

    def _compare(self, before: Moment, after: Moment, steps: list[Step], scored: bool) -> None:
        dt = after.time - before.time
        measured = all(step.accel_known and step.yaw_known for step in steps)
        self._fresh = not (measured and 0.0 < dt <= LONGEST_GAP) or after.camera is None
        if self._fresh or after.camera is None:
            return
        moved, (z, R, _) = Preintegration(before.x, steps), after.camera
        F = moved.jacobian()
        self._move_positions(moved, F, before.x)
        self._position.correct(z[:2], R[:2, :2], dt, scored)
        self._turn_headings(moved, F, before.x)
        near = self._heading.x[0, 0]
        psi = near + math.remainder(float(z[2]) - near, 2.0 * math.pi)
        self._heading.correct(np.array([psi]), R[2:, 2:], dt, scored)

    def _move_positions(self, moved: Preintegration, F: Array, x: Array) -> None:
        T, K, used = moved.duration, len(self._density), slice(0, self._measuring)
        A, u, Q = np.empty((K, 6, 6)), np.zeros((K, 6)), np.zeros((K, 6, 6))
        A[:] = F[POSITION_BLOCK]
        A[self._measuring :, :4, 4:] = 0.0
        u[used, :4] = (*moved.left_dv, *moved.dv) - A[0, :4, 4:] @ x[6:8]
        density = self._scale.position * self._density
        for p, v in ((0, 2), (1, 3)):
            Q[:, p, p] = T**3 / 3.0 * density
            Q[:, p, v] = Q[:, v, p] = T**2 / 2.0 * density
            Q[:, v, v] = T * density
        Q[used, 4, 4] = Q[used, 5, 5] = self._noise.accel_drift**2 * T
        self._position.predict(A, u, Q)

    def _turn_headings(self, moved: Preintegration, F: Array, x: Array) -> None:
        T, K = moved.duration, len(TURN_FACTORS)
        variance = sum(step.yaw_variance for step in moved.steps)
        variance += self._noise.heading_drift**2 * T
        Q = np.zeros((K, 2, 2))
        Q[:, 0, 0] = self._scale.heading * TURN_FACTORS * variance
        Q[:, 1, 1] = self._noise.gyro_drift**2 * T
        u = np.array((moved.turn - F[2, 5] * x[5], 0.0))
        self._heading.predict(F[HEADING_BLOCK][None], u, Q)

    def _choose(self) -> MotionModel:
        shares, turns = self._position.shares, self._heading.shares
        used = bool(shares[self._used].sum() > 0.5 - 1e-6)
        among = shares * (self._used == used)
        density = float(among @ self._density / among.sum())
        return MotionModel(used, density, float(turns @ TURN_FACTORS))
