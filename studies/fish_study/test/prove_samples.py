# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small scenarios of the blind study, and answers to them as the tool would write them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fish_sim.scheme import default_scheme
from fish_study import scenario_groups
from fish_study.scenario import Scenario
from fish_study.score import Score, score_scenario


def small(group: str, number: int = 0, **changes: Any) -> Scenario:
    """A scenario of a group with three trials of 4 s."""
    scenario = scenario_groups.GROUPS[group](np.random.default_rng(5), number)
    scheme = default_scheme(3)  # the kernel of other tests
    changes = {"method": scheme.method, "substeps": scheme.substeps, **changes}
    return replace(scenario, count=3, duration=4.0, **changes)


def diagnosis(
    *effects: tuple[str, str, float], verdict: str = "missing_physics", rivals: Sequence[str] = ()
) -> dict[str, Any]:
    """A result with these effects (name, kind, probability), each with the same rivals."""
    rows = [
        {
            "name": name,
            "kind": kind,
            "evidence": {"probability": p},
            "rivals": [{"name": n, "probability": 0.1} for n in rivals],
            "parameters": {"x": {"value": 0.031, "std": 0.0001}},
        }
        for name, kind, p in effects
    ]
    ranking = [{"name": "current", "gain": 9.0}, {"name": "quadratic_drag", "gain": 10.0}]
    fit = {"with_effects": {"rms": {}}, "refitted": {"rms": {"2 s": {"position_m": 0.010}}}}
    errors = {"current": 0.012, "wall_effect": 0.009}
    refitted = [{"name": n, "held_out_rms": {"2 s": {"position_m": e}}} for n, e in errors.items()]
    content = {
        "verdict": verdict,
        "effects": rows,
        "fit": fit,
        "ranking": ranking,
        "refitted": refitted,
    }
    return {"seconds": 60.0, "diagnosis": content}


def answered(
    group: str,
    hidden: tuple[str, ...],
    *named: str,
    kind: str = "physics",
    probability: float = 0.95,
    verdict: str = "missing_physics",
    rivals: tuple[str, ...] = (),
) -> Score:
    """A scenario of a group in which this is hidden, and the names that the tool gave."""
    scenario = Scenario(group, 0, {name: {"x": 0.03} for name in hidden})
    effects = [(name, kind, probability) for name in named]
    return score_scenario(scenario, diagnosis(*effects, verdict=verdict, rivals=rivals))


def failed(group: str, *hidden: str) -> Score:
    """A scenario on which the tool gave no answer."""
    result = {"seconds": 240.0, "diagnosis": None, "error": "exit status 3: cannot"}
    return score_scenario(Scenario(group, 0, {name: {} for name in hidden}), result)


def three_scenarios() -> list[Scenario]:
    kinds = (("single", 0), ("null", 0), ("outside", 4))
    return [small(group, number, seed=k) for k, (group, number) in enumerate(kinds)]
