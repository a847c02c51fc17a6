# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is asked of the diagnosis, fixed before any study, beside what a study measures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fish_report.page import Table
from fish_study.score import Score
from fish_study.share import Share


@dataclass(frozen=True)
class Asked:
    """A number the project asks for, fixed before the run.

    A scenario without an answer is never right; what must not happen is counted among answers, which alone can do it.
    """

    what: str
    asked: str
    among: Callable[[Score], bool]
    is_so: Callable[[Score], bool]


def _one(s: Score) -> bool:
    """A single named effect at full strength and common noise."""
    return len(s.truth) == 1 and s.scenario.group in ("single", "sensor")


def _answers(group: str) -> Callable[[Score], bool]:
    """A scenario of this group to which the tool gave an answer."""
    return lambda s: s.scenario.group == group and s.has_answer


ASKED = (
    Asked("right name first, single effects", "at least 90 %", _one, lambda s: s.top1),
    Asked("truth in the answered set, single effects", "at least 98 %", _one, lambda s: s.in_set),
    Asked(
        "right name first, closed loop only",
        "at most 5 points below open loop",
        lambda s: s.scenario.group == "feedback",
        lambda s: s.top1,
    ),
    Asked("false alarms, nothing hidden", "at most 2 %", _answers("null"), lambda s: s.alarm),
    Asked(
        "both of two effects",
        "at least 75 %",
        lambda s: s.scenario.group == "two",
        lambda s: set(s.truth) <= set(s.named),
    ),
    Asked(
        "no false third name",
        "at least 95 %",
        lambda s: s.scenario.group == "two",
        lambda s: s.has_answer and not s.false_names,
    ),
    Asked(
        "no name exists: called unexplained",
        "at least 85 %",
        lambda s: s.unnamed and s.scenario.group == "outside",
        lambda s: s.verdict == "unexplained",
    ),
    Asked(
        "no name exists: wrong name with confidence",
        "at most 5 %",
        lambda s: s.unnamed and s.scenario.group == "outside" and s.has_answer,
        lambda s: s.confident_wrong,
    ),
    Asked(
        "sensor impostors called physics",
        "at most 3 %",
        _answers("sensor"),
        lambda s: s.called_physics,
    ),
)


def asked_table(scores: Sequence[Score]) -> Table:
    """What was asked, what came out."""
    rows = [[a.what, a.asked, str(Share.of(filter(a.among, scores), a.is_so))] for a in ASKED]
    sets = [len(s.answered) for s in scores if _one(s) and s.answered]
    rows.append(
        [
            "mean size of the answered set, single effects",
            "at most 1.5",
            f"{np.mean(sets):.2f}" if sets else "–",
        ]
    )
    errors = [p.within for s in scores if _one(s) and s.top1 for p in s.parameters]
    good = Share(sum(errors), len(errors))
    rows.append(["parameters within 3 standard errors or 20 %, right names", "all", str(good)])
    seconds = [s.seconds for s in scores]
    rows.append(
        [
            "seconds per data set, median (longest)",
            "180",
            f"{np.median(seconds):.0f} ({max(seconds):.0f})",
        ]
    )
    note = (
        "Thresholds were fixed before the run. Intervals: exact, 95 %. A scenario without an answer is not right, and no "
        "evidence that false alarms, confident wrong names or impostors called physics are few."
    )
    return Table("Asked and measured", ["what", "asked", "measured"], rows, note)
