# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far off a prediction may be: what its parameters leave open, and what the model misses in trials left out.

    band^2 = t^2 (J C J' + s^2)

J: slope of the predicted stroke mean; C: covariance clustered by trial; s: robust spread of the training trials' errors at the
same horizon, each fold of trials predicted by the parameters without it; t: 97.5 % quantile of Student's t with M - 1 degrees of
freedom, as M training trials say how far trials differ. The first term alone would be the band of a model that is right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from fish_sysid.estimation.shooting.fold_steps import fold_of, without_folds
from fish_sysid.estimation.shooting.multistep import Multistep

Array = NDArray[np.float64]

NORMAL = 1.96  # standard deviations on both sides that hold 95 % of a normal distribution


def missed(training: Multistep, z: Array) -> dict[float, Array]:
    """Horizon -> (4,) spread of scaled errors on trials left out, by the quantile that a 95 % band needs."""
    states, horizon = training.states(z), training.targets.horizon
    fold = fold_of(len(training.experiment.names))[training.targets.trial]
    e = np.empty((len(fold), 4))
    for f, without in enumerate(without_folds(training, z, states)):
        e[fold == f] = training.errors(without, states)[0][fold == f]
    return {
        float(h): np.quantile(np.abs(e[horizon == h]), 0.95, axis=0) / NORMAL
        for h in np.unique(horizon)
    }


def inside(
    training: Multistep, unseen: Multistep, z: Array, covariance: Array, horizon: float
) -> NDArray[np.bool_]:
    """(R, 4) whether each error of unseen trials at a horizon [s] lies in its 95 % band: x, y, heading, speed."""
    e, J = unseen.errors(z, unseen.states(z), slopes=True)
    rows = unseen.targets.horizon == horizon
    e, J = e[rows], J[rows]
    open_left = np.einsum("rip,pq,riq->ri", J, covariance, J)
    trials = len(training.experiment.names)
    band = t.ppf(0.975, trials - 1) * np.sqrt(open_left + missed(training, z)[horizon] ** 2)
    return np.asarray(np.abs(e) <= band)
