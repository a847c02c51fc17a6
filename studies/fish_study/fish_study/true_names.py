# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which names count as right for a scenario: its own, or for another form or engine those that mean the same physics."""

from __future__ import annotations

from fish_study.other_forms import MEANS
from fish_study.scenario import Scenario


def true_names(scenario: Scenario) -> tuple[str, ...] | None:
    """Names of the vocabulary; None: the hidden effects' own names."""
    if scenario.plant != "mujoco":
        other = set(scenario.names) & set(MEANS)
        return tuple(MEANS.get(name, name) for name in scenario.names) if other else None
    from fish_study.mujoco_effects import CONCEALED

    return tuple(name for hidden in scenario.names for name in CONCEALED[hidden].names)
