# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tool said changed between two days, by what did."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_report.page import Table
from fish_study.scenario_groups import PAIRS_OF_DAYS
from fish_study.score import Score
from fish_study.share import Share

HEADER = (
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
ASKED = {
    "mujoco-pair": ("60", "nulls: at most 2 %", "at least 75 %", "at least 90 %", "at most 5 %", "–", "60 (180)"),
    "injected": ("100", "nulls: at most 2 %", "–", "of each kind at least 90 %", "–", "–", "60 (180)"),
}  # fmt: skip


def pair_tables(scores: Sequence[Score]) -> list[Table]:
    """One row for each kind of change of each group, then their sums; nothing without such groups."""
    rows = []
    for group in PAIRS_OF_DAYS:
        own = [s for s in scores if s.scenario.group == group]
        kinds = sorted({s.scenario.names for s in own})
        rows += [_row(group, k, [s for s in own if s.scenario.names == k]) for k in kinds]
        hidden = [s for s in own if s.scenario.names]
        if hidden:
            rows.append(_row(group, ("any",), hidden))
            rows.append([group, "asked", *ASKED[group]])
    if not rows:
        return []
    note = (
        "OLD and NEW are of different trials. Intervals: Wilson, 95 %. A name is right where it is what was changed; of two "
        "changes the first name is one of them and the family holds both. A wrong name alone: stated with a probability of 90 % "
        "or more, with nothing in its family that was changed."
    )
    return [Table("What changed", list(HEADER), rows, note)]


def _row(group: str, kind: tuple[str, ...], own: Sequence[Score]) -> list[str]:
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
