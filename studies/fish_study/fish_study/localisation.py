# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where localised effects really act, and how well an answer's times and covariates agree with that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_study.oracle import with_truth
from fish_study.scenario import Scenario
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.effect_wrench import effect_wrench
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate

LOCALISED = ("wall_effect", "wave_drag", "tether")  # they act here and not there


def true_wrench(scenario: Scenario, experiment: Experiment) -> MissingForce | None:
    """What a scenario's only effect does on these trials if it is localised: the true robot along the motion it smooths."""
    if len(scenario.effects) != 1 or scenario.plant != "fish_sim" or scenario.links != 3:
        return None
    name = next(iter(scenario.effects))
    if name not in LOCALISED:
        return None
    hypothesis, theta = with_truth(scenario, (name,))
    return effect_wrench(evaluate(hypothesis, theta, experiment, Noise()), name, experiment)


def dof_overlap(stated: Mapping[str, float], true: Mapping[str, float]) -> float:
    """1 where two sets of shares over the degrees of freedom are equal, 0 where they have nothing in common."""
    return float(sum(min(share, true.get(name, 0.0)) for name, share in stated.items()))


def stated_times(
    stated: Sequence[Mapping[str, Any]], names: Sequence[str], length: int
) -> NDArray[np.bool_]:
    """(T, M) when the intervals stated say that an effect acts, on the trials `names`."""
    said = np.zeros((length, len(names)), dtype=bool)
    for interval in stated:
        if interval["trial"] in names:
            begin, end = round(interval["from"] / DT), round(interval["to"] / DT)
            said[begin:end, list(names).index(interval["trial"])] = True
    return said


def stated_range(
    stated: Sequence[Mapping[str, Any]], covariates: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.bool_]:
    """(T, M) when the first covariate stated is in its range: the same said without knowing the recording."""
    value, (low, high) = covariates[stated[0]["name"]], stated[0]["range"]
    inside: NDArray[np.bool_] = (value >= low) & (value <= high)
    return inside


def overlap(said: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((said & true).sum() / max((said | true).sum(), 1))
