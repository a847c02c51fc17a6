# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detection power over the strength of what is hidden, beside the oracle's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fish_report.page import Table
from fish_study.score import Score
from fish_study.share import Share


@dataclass(frozen=True)
class Power:
    """At one strength."""

    strength: float
    found: Share  # truth in the answered set
    oracle: Share | None


def power(scores: Sequence[Score], oracle: Mapping[int, bool] | None = None) -> list[Power]:
    """Over the ladder of strengths; oracle: seed of a scenario -> whether the test that knows the name sees it."""
    ladder = [s for s in scores if s.scenario.group == "ladder"]
    steps = []
    for strength in sorted({s.scenario.strength for s in ladder}):
        own = [s for s in ladder if s.scenario.strength == strength]
        seen = [oracle[s.scenario.seed] for s in own if s.scenario.seed in oracle] if oracle else []
        steps.append(
            Power(
                strength,
                Share.of(own, lambda s: s.in_set),
                Share(sum(seen), len(seen)) if seen else None,
            )
        )
    return steps


def power_table(steps: Sequence[Power]) -> Table:
    """Rows of the power curve."""
    rows = [[f"{p.strength:g}", str(p.found), str(p.oracle) if p.oracle else "–"] for p in steps]
    note = "Strength 1: as in the known data sets. Oracle: likelihood-ratio test of the true structure, which knows the name."
    return Table(
        "Detection power over strength",
        ["strength", "truth in the answered set", "oracle detects"],
        rows,
        note,
    )
