# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What names gain where nothing is hidden: the level of the diagnosis held against its null distribution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from fish_report.page import Table
from fish_study.score import Score
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.thresholds import TEMPER


def null_table(scores: Sequence[Score]) -> Table | None:
    """Best quick gain of any name by tail links and noise of the null scenarios; None without one."""
    nulls = [s for s in scores if s.scenario.group == "null" and s.ranking]
    if not nulls:
        return None
    rows = []
    for links, noise in sorted({(s.scenario.links, s.scenario.noise) for s in nulls}):
        gains = [
            max(s.ranking.values())
            for s in nulls
            if (s.scenario.links, s.scenario.noise) == (links, noise)
        ]
        rows.append(
            [
                str(links),
                f"{noise:g}",
                str(len(gains)),
                f"{np.median(gains):.1f}",
                f"{max(gains):.1f}",
            ]
        )
    names = max(len(s.ranking) for s in nulls)
    level = Level()
    exact = 0.5 * float(chi2.isf(1.0 - 0.5 ** (1.0 / names), 1))
    note = (
        f"Nats by which the best of {names} names beats the refitted nominal model. Were the model the fish, independent "
        f"names of one parameter would have {exact:.1f} in the median. A name needs {level.needed(0.0, 1, names):.0f} or more: "
        f"the level of {level.false_alarms:.0%} false alarms times {TEMPER:g}, for tails and water that the model has not."
    )
    return Table(
        "What names gain where nothing is hidden",
        ["tail links", "noise", "scenarios", "median", "largest"],
        rows,
        note,
    )
