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
from fish_study.score import Score, score_scenario, true_names
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
    def right(self) -> tuple[bool, bool]:
        """Whether the recorded answer is right, and this one."""
        scenario, results = self.recorded.scenario, (self.recorded.result, self.result)
        truth = true_names(scenario)
        before, now = (is_right(score_scenario(scenario, result, truth)) for result in results)
        return before, now

    @property
    def error_ratio(self) -> float:
        """Position error 2 s ahead on held-out trials, of this answer's model over the recorded one's."""
        before, now = (position_error(result) for result in (self.recorded.result, self.result))
        return now / before

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


def is_right(score: Score) -> bool:
    """All hidden names and no other; `unexplained` where something without a name is hidden; no alarm where nothing is."""
    if score.unnamed:
        return score.verdict == "unexplained"
    return score.exact if score.truth else score.has_answer and not score.alarm


def position_error(result: Answer) -> float:
    """m, of the answer's model.yaml 2 s ahead on held-out trials; NaN without an answer."""
    if not result["diagnosis"]:
        return np.nan
    fit = result["diagnosis"]["fit"]
    model = fit["model_yaml"] or fit[fit["written"]]  # null where it is one of the fits
    return number(model["rms"].get("2 s", {}).get("position_m"))


def lost(compared: Sequence[Comparison]) -> int:
    """Right answers of the record that are wrong now, less wrong ones that are right now."""
    return sum(before - now for before, now in (c.right for c in compared))


def stage_table(stage: str, changed: int, compared: Sequence[Comparison]) -> Table:
    """What the answers are worth without one stage, in scenarios whose search it changed."""
    right = [c.right for c in compared]
    ratios = [c.error_ratio for c in compared if np.isfinite(c.error_ratio)]
    seconds = [[float(r["seconds"]) for r in (c.recorded.result, c.result)] for c in compared]
    row = [
        stage,
        str(changed),
        str(len(compared)),
        str(sum(before for before, _ in right)),
        str(sum(now for _, now in right)),
        str(sum(not (c.same_names and c.same_verdict) for c in compared)),
        ", ".join(f"{q:.2f}" for q in np.quantile(ratios, (0.5, 1.0))) if ratios else "–",
        ", ".join(f"{s:.0f}" for s in np.median(seconds, axis=0)) if seconds else "–",
    ]
    header = ["stage left out", "searches that it changed", "run without it", "right with it"]
    note = (
        "Right: all hidden names and no other; `unexplained` where something without a name is hidden; no alarm where nothing "
        "is. Error: of model.yaml's position 2 s ahead on held-out trials, without the stage over with it, median and largest. "
        "Seconds: medians, which may be of other computers."
    )
    return Table(
        "One stage left out",
        [*header, "right without it", "other answers", "error", "s, with; without"],
        [row],
        note,
    )


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
