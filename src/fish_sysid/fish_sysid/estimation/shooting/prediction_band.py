# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far off a prediction may be: what its parameters leave open, and what the model missed in training.

    band^2 = J C J' + s^2,   s: robust spread of the training trials' errors at the same horizon

J: slope of the predicted stroke mean; C: covariance clustered by trial. The first term alone would be the band of a model that is
right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sysid.estimation.shooting.multistep import Multistep

Array = NDArray[np.float64]

NORMAL = 1.96  # standard deviations on both sides that hold 95 % of a normal distribution


def missed(training: Multistep, z: Array) -> dict[float, Array]:
    """Horizon -> (4,) spread of scaled errors on training trials, by the quantile that a 95 % band needs."""
    e, horizon = training.errors(z, training.states(z))[0], training.targets.horizon
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
    band = NORMAL * np.sqrt(open_left + missed(training, z)[horizon] ** 2)
    return np.asarray(np.abs(e) <= band)
