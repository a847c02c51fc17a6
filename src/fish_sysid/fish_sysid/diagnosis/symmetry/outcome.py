# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What becomes of symmetry findings: a place in diagnosis.json, numbers of the robot, a uniform flow out of the recordings."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_current
from fish_sysid.diagnosis.symmetry.finding import Estimate, Evidence, SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import CONTAINED_IN, GIVEN, in_any
from fish_sysid.diagnosis.vocabulary import candidates, kind_of
from fish_sysid.estimation.parametrization import EffectTable, effect_class

FLOW = "current"

Entry = dict[str, Any]


def applicable(findings: Sequence[SymmetryFinding], robot: Robot) -> list[SymmetryFinding]:
    """Stated findings that give all parameters of an effect which the robot has not."""
    own = {*robot.effects, *robot.sensors}
    return [
        f
        for f in stated(findings)
        if f.name not in own
        and set(f.parameters) == set(effect_class(f.name, robot.table).parameters)
    ]


def beyond(names: Collection[str], findings: Sequence[SymmetryFinding]) -> list[SymmetryFinding]:
    """Findings that no effect of these names has in it."""
    return [f for f in findings if not in_any(f.name, names)]


def with_findings(robot: Robot, findings: Sequence[SymmetryFinding]) -> Robot:
    """The robot with every applicable finding as an effect or sensor error, cut to the effect's range."""
    for finding in applicable(findings, robot):
        ranges = effect_class(finding.name, robot.table).parameters
        values = {
            key: float(min(max(p.value, ranges[key].lowest), ranges[key].highest))
            for key, p in finding.parameters.items()
        }
        robot = robot.with_effect(finding.name, **values)
    return robot


def in_still_water(experiment: Experiment, findings: Sequence[SymmetryFinding]) -> Experiment:
    """The recordings as the water sees them, where a uniform flow is stated (Galilei); otherwise as they are."""
    flow = next((f.parameters for f in stated(findings) if f.name == FLOW), None)
    if flow is None:
        return experiment
    return with_current(experiment, (-flow["x"].value, -flow["y"].value))


def symmetry_entry(findings: Iterable[SymmetryFinding]) -> list[Entry]:
    """Every test with what it assumes, needs and found."""
    return [
        {
            "name": f.name,
            "kind": f.kind,
            "status": f.status,
            "reason": f.reason,
            "statement": f.statement,
            "assumes": f.assumes,
            "needs": f.needs,
            "stands_alone": f.stands_alone,
            "parameters": parameters_entry(f.parameters),
            "evidence": f.evidence and _evidence(f.evidence),
        }
        for f in findings
    ]


def stated(findings: Sequence[SymmetryFinding]) -> list[SymmetryFinding]:
    """Findings that are effects: names of the vocabulary that need no mirror symmetry and that the robot does not have."""
    found = [
        f
        for f in findings
        if f.status == "found" and f.stands_alone and f.reason != GIVEN and f.name in candidates()
    ]
    names = {f.name for f in found}
    return [f for f in found if CONTAINED_IN.get(f.name) not in names]


def with_symmetry(
    effects: Sequence[Entry], findings: Sequence[SymmetryFinding], table: EffectTable
) -> list[Entry]:
    """The effects of the search with the symmetry's numbers beside, and those that only the symmetry finds.

    Other entries keep their numbers.
    """
    entries = [{**entry, "evidence": {**entry["evidence"]}} for entry in effects]
    for finding in stated(findings):
        names = (finding.name, CONTAINED_IN.get(finding.name))
        same = [entry for entry in entries if entry["name"] in names]
        if not same:
            entries.append(_effect(finding, table))
        for entry in same:
            entry["evidence"]["symmetry"] = {
                "name": finding.name,
                "parameters": parameters_entry(finding.parameters),
                **(_evidence(finding.evidence) if finding.evidence else {}),
            }
    return entries


def _effect(finding: SymmetryFinding, table: EffectTable) -> Entry:
    """An effect by symmetry alone; what only a model of the fish tells is absent."""
    effect = effect_class(finding.name, table)
    absent = {key: Estimate(p.value, math.nan, p.unit) for key, p in effect.parameters.items()}
    told = finding.evidence or Evidence(math.nan, math.nan, math.nan)
    return {
        "name": finding.name,
        "kind": kind_of(finding.name, table),
        "equation": effect.equation,
        "statement": finding.statement,
        "parameters": parameters_entry({**absent, **finding.parameters}),
        "evidence": {
            "basis": "symmetry",
            "log_likelihood_gain": math.nan,
            "probability": 1.0 - told.p_value,
            **_evidence(told),
        },
        "share": math.nan,
        "rivals": [],
        "where": nowhere(),
    }


def nowhere() -> Entry:
    """`where` of an effect that no model of the fish locates."""
    return {"dof": {}, "covariates": [], "time": [], "place": []}


def parameters_entry(parameters: Mapping[str, Estimate]) -> Entry:
    """`parameters` of an entry: value, std and unit by name."""
    return {key: asdict(estimate) for key, estimate in parameters.items()}


def _evidence(told: Evidence) -> Entry:
    return {
        "left_out_log_gain": told.gain,
        "left_out_log_gain_std": told.std,
        "p_value": told.p_value,
    }
