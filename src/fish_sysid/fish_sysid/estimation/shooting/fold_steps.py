# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters without a fold of trials: one Gauss-Newton step from those of all trials.

    z_f = z - (N - sum over f of J' W J)^-1 (g - sum over f of J' W e)

N, g: Gauss-Newton matrix and gradient of all trials, with the prior. Near the optimum this is the fit to the rest of the trials
to second order, at a fraction of the time (Beirami et al. 2017; Giordano et al. 2019).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sysid.estimation.shooting.huber import weight
from fish_sysid.estimation.shooting.multistep import LARGEST_STEP, Multistep

Array = NDArray[np.float64]

FOLDS = 4
DAMPINGS = (0.0, 0.01, 0.1, 1.0)


def fold_of(trials: int) -> NDArray[np.int64]:
    """(M,) which fold each of so many trials is in."""
    return np.arange(trials) % FOLDS


def fold_steps(
    e: Array,
    J: Array,
    gradient: Array,
    normal: Array,
    fold: NDArray[np.int64],
    damping: float = 0.0,
) -> Array:
    """(F, P) Gauss-Newton steps of the cost without the rows of each fold.

    e: (R, 4) errors; J: (R, 4, P) slopes; gradient (P,) and normal (P, P) of the whole cost; fold: (R,) that of each row;
    damping: of the diagonal (Marquardt 1963).
    """
    weighted, out = weight(e), []
    for f in range(fold.max() + 1):
        own, w, rows = e[fold == f], weighted[fold == f], J[fold == f]
        rest = normal - np.einsum("rsp,rs,rsq->pq", rows, w, rows)
        rest += damping * np.diag(np.diag(rest))
        out.append(-np.linalg.solve(rest, gradient - np.einsum("rsp,rs->p", rows, w * own)))
    clipped: Array = np.clip(np.array(out), -LARGEST_STEP, LARGEST_STEP)
    return clipped


def without_folds(cost: Multistep, z: Array, states: Array) -> Array:
    """(F, P) parameters without each fold of trials, from z (P,) and its start states (S, NS).

    Of steps with more and more damping the one that lowers the cost of the rest of the trials most.
    """
    e, J = cost.errors(z, states, slopes=True)
    fold = fold_of(len(cost.experiment.names))[cost.targets.trial]
    gradient, normal = cost.normal(z, e, J)
    steps = np.stack([fold_steps(e, J, gradient, normal, fold, d) for d in DAMPINGS], axis=1)
    steps[..., cost.imu_clock] = 0.0
    out = []
    for f, own in enumerate(steps):
        tried = [cost.clip(z + step) for step in own]
        sizes = [cost.total(t, cost.errors(t, states)[0][fold != f]) for t in tried]
        out.append(tried[int(np.argmin(sizes))])
    return np.array(out)
