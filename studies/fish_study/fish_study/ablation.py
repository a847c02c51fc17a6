# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which stages of the diagnosis pay: the same scenarios diagnosed with each stage of the search left out in turn.

OUT/complete and OUT/without_STAGE are studies of their own, all of one seed: each goes on where it was stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.files import write_json
from fish_report.page import Table
from fish_study.answer_tables import ASKED
from fish_study.new_study import Asked, begin_or_go_on
from fish_study.runner import DIAGNOSE, run_study
from fish_study.score import Score, study_scores
from fish_study.share import Share
from fish_study.study import Study, StudyError

COMPLETE = "complete"
HEADER = [
    "stage left out",
    "right name first",
    "truth in the set",
    "false alarms",
    "both of two",
    "unexplained right",
    "searches changed",
    "s of these, with and without it",
]


def search_stages() -> tuple[str, ...]:
    """Names of the stages that `diagnose(..., without=...)` can leave out."""
    from fish_sysid.diagnosis.task import STAGES

    return tuple(name for name, _ in STAGES)


def check_stages(stages: Sequence[str]) -> None:
    """Raise StudyError for a stage that the diagnosis does not have."""
    known = search_stages()
    unknown = [stage for stage in stages if stage not in known]
    if unknown:
        raise StudyError(
            f"--without: got {', '.join(unknown)}; expected stages of the diagnosis: {', '.join(known) or 'this one has none'}"
        )


def ablation_studies(out: Path, asked: Asked, stages: Sequence[str]) -> dict[str, Study]:
    """The complete diagnosis and one study for each stage left out, name -> study, all with the same scenarios."""
    complete = begin_or_go_on(out / COMPLETE, asked, {"without": ""})
    about = complete.about
    same = replace(asked, **{k: about[k] for k in asked.values()}, given=frozenset(asked.values()))
    return {COMPLETE: complete} | {
        stage: begin_or_go_on(out / f"without_{stage.replace(' ', '_')}", same, {"without": stage})
        for stage in stages
    }


def run_ablation(
    studies: Mapping[str, Study], jobs: int, done: Callable[[str], None], cluster: str = ""
) -> None:
    """Run every scenario of every study that has no result yet.

    A search that a stage has not changed gives the same answer without it: that answer is taken and not computed again.
    """
    for name, study in studies.items():
        tool = DIAGNOSE if name == COMPLETE else (*DIAGNOSE, "--without", name)
        if name != COMPLETE:
            for scenario in take_same_answers(studies[COMPLETE], study, name):
                done(scenario)
        run_study(study, jobs, done, tool, cluster=cluster)


def _seconds(complete: Study, without: Study, names: Sequence[str]) -> str:
    """Median time of these searches, complete and without a stage."""
    if not names:
        return "–"
    both = [[study.results[name]["seconds"] for name in names] for study in (complete, without)]
    return ", ".join(f"{np.median(seconds):.0f}" for seconds in both)


def take_same_answers(complete: Study, study: Study, stage: str) -> list[str]:
    """Copy the answers of the complete search where this stage did not change it; names of these scenarios."""
    changed = set(changed_by(complete, stage))
    same = [name for name in study.pending if name not in changed]
    for name in same:
        study.folder_of(name).mkdir(parents=True, exist_ok=True)
        write_json(study.folder_of(name) / "result.json", complete.results[name])
    return same


def says_changed(result: Mapping[str, Any], stage: str) -> bool:
    """Whether an answer says that a stage has changed its search."""
    return bool(result["diagnosis"]) and stage in result["diagnosis"].get("stages", ())


def changed_by(complete: Study, stage: str) -> list[str]:
    """Names of the scenarios whose search a stage has changed, or whose answer does not say so."""
    return [
        name
        for name, result in complete.results.items()
        if "stages" not in (result["diagnosis"] or {}) or says_changed(result, stage)
    ]


def ablation_table(studies: Mapping[str, Study]) -> Table:
    """One row for each stage left out, the complete diagnosis first."""
    scores = {name: study_scores(study) for name, study in studies.items()}
    asked = {row.what: row for row in ASKED}

    def count(own: Sequence[Score], what: str) -> str:
        return Share.of(filter(asked[what].among, own), asked[what].is_so).short

    rows = []
    for name, own in scores.items():
        named = [s for s in own if len(s.truth) == 1]
        changed = [] if name == COMPLETE else changed_by(studies[COMPLETE], name)
        rows.append(
            [
                "nothing" if name == COMPLETE else name,
                Share.of(named, lambda s: s.top1).short,
                Share.of(named, lambda s: s.in_set).short,
                count(own, "false alarms, nothing hidden"),
                count(own, "both of two effects"),
                count(own, "no name exists: called unexplained"),
                "–" if name == COMPLETE else f"{len(changed)}/{len(own)}",
                _seconds(studies[COMPLETE], studies[name], changed),
            ]
        )
    note = (
        "Every row is of the same scenarios. Right name first and truth in the set: scenarios of all groups with one hidden "
        "name. False alarms: nothing hidden. Unexplained right: something hidden that has no name. Seconds are medians."
    )
    return Table("Each stage of the search left out in turn", HEADER, rows, note)
