# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Today's diagnosis against recorded answers: the same verdict, the same names, the same parameters?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.files import number
from fish_report.page import Table
from fish_study.scenario import Scenario
from fish_study.scenario_groups import GROUPS
from fish_study.share import Share
from fish_study.study import Study

WITHIN = 1.0  # recorded standard errors within which a parameter counts as the same
Answer = Mapping[str, Any]  # as in result.json


@dataclass(frozen=True)
class Recorded:
    """A scenario of an archive and its recorded answer."""

    name: str  # PART_SCENARIO, as in the archive
    scenario: Scenario
    result: Answer


@dataclass(frozen=True)
class Comparison:
    """One scenario diagnosed again."""

    recorded: Recorded
    result: Answer

    @property
    def same_verdict(self) -> bool:
        """Both the same; no answer is a verdict of its own."""
        return verdict(self.recorded.result) == verdict(self.result)

    @property
    def same_names(self) -> bool:
        """The same effects, in whatever order."""
        return set(effects(self.recorded.result)) == set(effects(self.result))

    @property
    def largest_difference(self) -> float:
        """Of any parameter of an effect that both name, in recorded standard errors; 0 without one."""
        old, new = effects(self.recorded.result), effects(self.result)
        differences = [
            abs(number(new[name][key]["value"]) - number(p["value"])) / number(p["std"])
            for name in old.keys() & new.keys()
            for key, p in old[name].items()
            if key in new[name] and number(p["std"]) > 0.0
        ]
        return max((d for d in differences if np.isfinite(d)), default=0.0)


def verdict(result: Answer) -> str:
    """The verdict of an answer, "failed" without one."""
    return str(result["diagnosis"]["verdict"]) if result["diagnosis"] else "failed"


def effects(result: Answer) -> dict[str, dict[str, Any]]:
    """Name -> parameters of the effects of an answer."""
    found = result["diagnosis"]["effects"] if result["diagnosis"] else []
    return {effect["name"]: effect["parameters"] for effect in found}


def recorded_answers(studies: Sequence[Study]) -> list[Recorded]:
    """Every scenario of studies, in an order that takes one of each group in turn, quick ones first."""
    rows = [
        Recorded(f"{study.folder.name}_{name}", scenario, result)
        for study in studies
        for (name, scenario), result in zip(
            study.open_labels().items(), study.results.values(), strict=True
        )
    ]
    rows.sort(key=lambda row: float(row.result["seconds"]))
    of_group = [[row for row in rows if row.scenario.group == group] for group in GROUPS]
    return [row for turn in zip_longest(*of_group) for row in turn if row is not None]


def comparison_tables(compared: Sequence[Comparison]) -> list[Table]:
    """One row per group, and one per scenario."""
    return [_groups(compared), _scenarios(compared)]


def _groups(compared: Sequence[Comparison]) -> Table:
    rows = []
    for group in [*GROUPS, "all"]:
        own = [c for c in compared if group in (c.recorded.scenario.group, "all")]
        if not own:
            continue
        both = [c for c in own if effects(c.recorded.result) and c.same_names]
        before, now = (
            np.median([float(result["seconds"]) for result in results])
            for results in ([c.recorded.result for c in own], [c.result for c in own])
        )
        rows.append(
            [
                group,
                str(len(own)),
                Share.of(own, lambda c: c.same_verdict).short,
                Share.of(own, lambda c: c.same_names).short,
                Share.of(both, lambda c: c.largest_difference <= WITHIN).short,
                f"{before:.0f}",
                f"{now:.0f}",
            ]
        )
    header = ["group", "scenarios", "same verdict", "same names", "parameters the same"]
    note = (
        f"Parameters the same: every parameter of every effect within {WITHIN:g} recorded standard errors, of scenarios with the "
        "same names. Seconds: medians of the recorded answers and of these, which may be of other computers."
    )
    return Table(
        "Against the recorded answers",
        [*header, "s, recorded", "s, now"],
        rows,
        note,
    )


def _scenarios(compared: Sequence[Comparison]) -> Table:
    rows = [
        [
            c.recorded.name,
            c.recorded.scenario.group,
            ", ".join(c.recorded.scenario.names) or "nothing",
            ", ".join(effects(c.recorded.result)) or verdict(c.recorded.result),
            ", ".join(effects(c.result)) or verdict(c.result),
            f"{c.largest_difference:.2f}",
            f"{c.recorded.result['seconds']:.0f}; {c.result['seconds']:.0f}",
        ]
        for c in compared
    ]
    header = ["scenario", "group", "hidden", "recorded", "now", "largest difference", "s"]
    note = "Largest difference: of a parameter, in recorded standard errors."
    return Table("Scenarios", header, rows, note)


def folder_of(out: Path, recorded: Recorded) -> Path:
    """Where the new answer of a scenario is kept."""
    return out / recorded.name
