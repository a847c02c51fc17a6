# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the answers: what is asked of the diagnosis, by group, by what is hidden, of pairs of days, and without an answer.

What is asked is fixed before any study.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fish_report.page import Table
from fish_study.scenario_groups import GROUPS, PAIRS_OF_DAYS
from fish_study.score import Score
from fish_study.share import Share

PAIR_HEADER = (
    "group",
    "changed in truth",
    "pairs",
    "called changed",
    "right name first",
    "right name in the family",
    "a wrong name alone",
    "not comparable or no answer",
    "s, median (longest)",
)


# fixed before any study
PAIR_ASKED = {
    "mujoco-pair": ("60", "nulls: at most 2 %", "at least 75 %", "at least 90 %", "at most 5 %", "–", "60 (180)"),
    "injected": ("100", "nulls: at most 2 %", "–", "of each kind at least 90 %", "–", "–", "60 (180)"),
}  # fmt: skip


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


def group_table(scores: Sequence[Score]) -> Table:
    """One row per group."""
    header = [
        "group",
        "scenarios",
        "right name first",
        "truth in set",
        "set size",
        "all right",
        "a false name",
        "alarm",
        "unexplained",
        "no answer",
        "s, median",
    ]
    rows = []
    for group in GROUPS:
        own = [s for s in scores if s.scenario.group == group]
        if not own:
            continue
        named = [s for s in own if s.truth]
        sizes = [len(s.answered) for s in own if s.answered]
        rows.append(
            [
                group,
                str(len(own)),
                Share.of(named, lambda s: s.top1).short,
                Share.of(named, lambda s: s.in_set).short,
                f"{np.mean(sizes):.2f}" if sizes else "–",
                Share.of(named, lambda s: s.exact).short,
                Share.of(own, lambda s: bool(s.false_names)).short,
                Share.of(own, lambda s: s.alarm).short,
                Share.of(own, lambda s: s.verdict == "unexplained").short,
                str(sum(not s.has_answer for s in own)),
                f"{np.median([s.seconds for s in own]):.0f}",
            ]
        )
    note = "; ".join(
        f"{name}: {(f.__doc__ or '').strip().rstrip('.')}"
        for name, f in GROUPS.items()
        if any(row[0] == name for row in rows)
    )
    return Table("Groups", header, rows, note + ".")


def name_table(scores: Sequence[Score]) -> Table:
    """What was answered to each single hidden name."""
    rows = []
    for name in sorted({n for s in scores for n in s.scenario.names}):
        own = [s for s in scores if s.scenario.names == (name,)]
        answers = [", ".join(s.named) or s.verdict for s in own]
        if answers:
            counted = sorted(
                {a: answers.count(a) for a in answers}.items(), key=lambda item: -item[1]
            )
            rows.append([name, str(len(own)), "; ".join(f"{a} ({n})" for a, n in counted)])
    note = "All groups with one hidden thing, whatever its strength and noise."
    return Table("Answers by what was hidden", ["hidden", "scenarios", "answers"], rows, note)


def failure_table(scores: Sequence[Score]) -> Table:
    """Scenarios on which the tool gave no answer; they count as not right everywhere."""
    rows = [
        [
            s.scenario.group,
            ", ".join(s.scenario.names) or "nothing",
            " ".join(s.error.split())[:200],
        ]
        for s in scores
        if not s.has_answer
    ]
    return Table(
        "No answer",
        ["group", "hidden", "what was said"],
        rows,
        "A scenario without an answer counts as not right.",
    )


def pair_tables(scores: Sequence[Score]) -> list[Table]:
    """One row for each kind of change of each group, then their sums; nothing without such groups."""
    rows = []
    for group in PAIRS_OF_DAYS:
        own = [s for s in scores if s.scenario.group == group]
        kinds = sorted({s.scenario.names for s in own})
        rows += [_pair_row(group, k, [s for s in own if s.scenario.names == k]) for k in kinds]
        hidden = [s for s in own if s.scenario.names]
        if hidden:
            rows.append(_pair_row(group, ("any",), hidden))
            rows.append([group, "asked", *PAIR_ASKED[group]])
    if not rows:
        return []
    note = (
        "OLD and NEW are of different trials. Intervals: Wilson, 95 %. A name is right where it is what was changed; of two "
        "changes the first name is one of them and the family holds both. A wrong name alone: stated with a probability of 90 % "
        "or more, with nothing in its family that was changed."
    )
    return [Table("What changed", list(PAIR_HEADER), rows, note)]


def _pair_row(group: str, kind: tuple[str, ...], own: Sequence[Score]) -> list[str]:
    named = [s for s in own if s.truth]
    seconds = [s.seconds for s in own]
    return [
        group,
        ", ".join(kind) or "nothing",
        str(len(own)),
        Share.of(own, lambda s: s.changed is True).wilson,
        Share.of(named, lambda s: s.top1).wilson,
        Share.of(named, lambda s: s.in_family).wilson,
        Share.of(own, lambda s: s.wrong_alone).wilson,
        str(sum(s.changed is None for s in own)),
        f"{np.median(seconds):.0f} ({max(seconds):.0f})",
    ]
