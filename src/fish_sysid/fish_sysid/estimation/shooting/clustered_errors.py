# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Standard errors of a fit whose errors hang together within a trial: the sandwich, clustered by trial.

    C = N^-1 (M / (M - 1) sum over trials of s_m s_m' + diag(1 / prior^2)) N^-1

N: Gauss-Newton matrix with the prior; s_m: gradient of trial m's cost (Liang and Zeger 1986; Cameron and Miller 2015). What
the trials do not determine keeps the prior's width. Errors of a wrong model last for seconds, so that a covariance that counts
them as independent is many times too small.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def clustered_covariance(scores: Array, normal: Array, prior: Array) -> Array:
    """(P, P) from scores by trial (M, P), the normal matrix with the prior (P, P) and the prior's deviations (P,).

    A trial without an error has a score of 0 and does not count. Of a single trial nothing is known but its normal matrix: C is
    its inverse.
    """
    said = scores[np.any(scores != 0.0, axis=1)]
    count = len(said)
    bread = np.linalg.inv(normal)
    if count < 2:
        return np.asarray(bread)
    centred = said - said.mean(axis=0)
    meat = count / (count - 1.0) * centred.T @ centred + np.diag(1.0 / prior**2)
    return np.asarray(bread @ meat @ bread)


def scores_by_trial(e: Array, weighted: Array, J: Array, trial: NDArray[np.int64]) -> Array:
    """(M, P) sums of J' W e of errors e (R,) with weights (R,), slopes J (R, P) and the trial of each."""
    count = int(trial.max()) + 1 if len(trial) else 0
    out = np.zeros((count, J.shape[1]))
    np.add.at(out, trial, J * (weighted * e)[:, None])
    return out
