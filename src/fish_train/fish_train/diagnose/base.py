"""The model before an effect is added, fitted to recordings that it may not explain."""

from __future__ import annotations

from fish_train.identify.cold import SUSPICIOUS, excess
from fish_train.identify.experiment import Experiment
from fish_train.identify.fit import Fit, settle

ROUNDS, ROUNDS_OF_A_WRONG_MODEL = 5, 2  # of noise and parameters in turn, at most


def settle_base(fit: Fit, experiment: Experiment) -> Fit:
    """`settle`, which a model that lacks something would drag on: its noise has taken in what it lacks."""
    return settle(fit, experiment, ROUNDS_OF_A_WRONG_MODEL if excess(fit).max() > SUSPICIOUS else ROUNDS)
