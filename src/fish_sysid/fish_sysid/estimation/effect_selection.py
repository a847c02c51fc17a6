"""What trials cost that a model fitted to the others has not seen, with the filter's states.

`shooting.selection` chooses effects by predictions from states of another kind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.multistep_fit import MultistepError

Array = NDArray[np.float64]

FOLDS = 4
ROUNDS = 2  # of states and parameters without a fold


def left_out_costs(
    outlook_on: Callable[[Experiment], MultistepError],
    theta: Array,
    noise: Noise,
    experiment: Experiment,
    folds: int = FOLDS,
) -> Array:
    """(M,) mean cost per prediction of each trial by parameters that were fitted, from theta, without its fold.

    NaN for what no other fold can foretell.
    """
    count = len(experiment.names)
    costs = np.full(count, np.nan)
    for fold in range(min(folds, count)):
        left_out = [m for m in range(count) if m % folds == fold]
        rest = [m for m in range(count) if m % folds != fold]
        if not rest:
            continue
        others, fitted = outlook_on(experiment.select(rest)), theta
        for _ in range(ROUNDS):
            _, fitted = others.improve(fitted, noise)
        unseen = outlook_on(experiment.select(left_out))
        unseen.start_from(fitted, noise)
        costs[left_out] = unseen.mean_costs(fitted)
    return costs
