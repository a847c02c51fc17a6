# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects that predictions of trials left out ask for, where the likelihood gives no name.

Where the likelihood cannot be asked they are effects of the answer. Where it was asked and gave no name, they are stated under
`unexplained`: what helps predictions may stand in the place of something else that the model lacks.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fish_sysid.diagnosis.corrected_model import asked_by_predictions, standing
from fish_sysid.diagnosis.prediction_rivals import Named
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.outcome import nowhere, parameters_entry
from fish_sysid.diagnosis.vocabulary import family_of, kind_of
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import effect_class


def effect_parameters(fit: Fit, name: str) -> dict[str, dict[str, Any]]:
    """Values, standard errors and units of an effect's parameters."""
    values, errors = fit.values, fit.standard_errors
    effect = fit.hypothesis.effect(name)
    return parameters_entry(
        {
            key: Estimate(values[f"{name}.{key}"], errors[f"{name}.{key}"], parameter.unit)
            for key, parameter in effect.parameters.items()
        }
    )


Entry = dict[str, Any]


def prediction_entries(d: Diagnosis) -> list[Entry]:
    """What predictions ask for where the likelihood gives no name, `basis` "prediction"; none where it cannot be asked.

    cost_ratio: cost of predicting trials left out with the effect over that of the control without it.
    """
    return [_entry(d, asked) for asked in standing(d)] if d.misses is None else []


def prediction_effects(d: Diagnosis) -> list[Entry]:
    """The effects by prediction as entries of `effects`.

    probability: 1 - p_value, shared equally with the members of the family that do as well.
    """
    found = asked_by_predictions(d)
    total = sum(asked.step.gain for asked in found)
    return [_effect(d, asked, asked.step.gain / total) for asked in found]


def _entry(d: Diagnosis, asked: Named) -> Entry:
    assert d.surrogate is not None
    step = asked.step
    return {
        "name": step.name,
        "kind": kind_of(step.name, d.task.robot.table),
        "parameters": effect_parameters(d.surrogate, step.name),
        "evidence": {
            "basis": "prediction",
            "cost_ratio": float(np.exp(-step.gain)),
            "log_gain": step.gain,
            "log_gain_std": step.deviation,
            "p_value": step.p_value,
        },
    }


def _effect(d: Diagnosis, asked: Named, share: float) -> Entry:
    """Fields of one entry of `effects`; what only a search by likelihood knows is absent."""
    entry, table = _entry(d, asked), d.task.robot.table
    name, own = asked.step.name, entry["parameters"]
    probability = (1.0 - asked.step.p_value) / (1 + len(asked.rivals))
    entry["evidence"] |= {"log_likelihood_gain": math.nan, "probability": probability}
    members = [
        (name, own),
        *((rival, _values(rival, table, v)) for rival, v in asked.rivals.items()),
    ]
    family = [
        {"name": member, "probability": probability, "parameters": parameters}
        for member, parameters in members
    ]
    return {
        **entry,
        "equation": effect_class(name, table).equation,
        "share": share,
        "rivals": [{"name": rival, "probability": probability} for rival in asked.rivals],
        "family": {"name": family_of(name), "members": family}
        if asked.rivals
        else {"name": "", "members": []},
        "where": nowhere(),
    }


def _values(name: str, table: Any, values: dict[str, float]) -> Entry:
    """Parameters of a rival, whose standard errors nobody worked out."""
    own = effect_class(name, table).parameters
    return parameters_entry(
        {key: Estimate(value, math.nan, own[key].unit) for key, value in values.items()}
    )
