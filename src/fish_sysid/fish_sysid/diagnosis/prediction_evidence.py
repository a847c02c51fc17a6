# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects that predictions of trials left out ask for, where the likelihood gives no name."""

from __future__ import annotations

from typing import Any

import numpy as np

from fish_sysid.diagnosis.effect_parameters import effect_parameters
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.diagnosis.vocabulary import kind_of


def prediction_entries(d: Diagnosis) -> list[dict[str, Any]]:
    """The effects of the surrogate model with their evidence, `basis` "prediction"; none without such a model.

    cost_ratio: cost of predicting trials left out with the effect over that of the control without it.
    """
    surrogate = d.surrogate
    if surrogate is None:
        return []
    return [
        {
            "name": step.name,
            "kind": kind_of(step.name, d.task.robot.table),
            "parameters": effect_parameters(surrogate, step.name),
            "evidence": {
                "basis": "prediction",
                "cost_ratio": float(np.exp(-step.gain)),
                "log_gain": step.gain,
                "log_gain_std": step.deviation,
            },
        }
        for step in d.predicted
    ]
