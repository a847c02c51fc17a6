# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Are the tool's statistics right: stated probabilities, the level held against the null distribution, detection power?"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from fish_report.page import Table
from fish_study.score import Score
from fish_study.share import Share
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.thresholds import TEMPER

EDGES = (0.0, 0.5, 0.8, 0.95, 1.0)  # of the bins of stated probability


@dataclass(frozen=True)
class Bin:
    """Answers whose first name was stated with a probability in [low, high)."""

    low: float
    high: float
    stated: float  # mean
    right: Share


def calibration(scores: Sequence[Score]) -> list[Bin]:
    """Stated probability of the first name against how often it is a hidden one."""
    bins = []
    for low, high in itertools.pairwise(EDGES):
        own = [s for s in scores if s.named and low <= s.probability < high + (high == 1.0)]
        if own:
            mean = float(np.mean([s.probability for s in own]))
            bins.append(Bin(low, high, mean, Share.of(own, lambda s: s.top1)))
    return bins


def calibration_table(scores: Sequence[Score]) -> Table:
    """Bins and the Brier score."""
    rows = [
        [f"{b.low:g} to {b.high:g}", f"{b.stated:.2f}", str(b.right)] for b in calibration(scores)
    ]
    named = [s for s in scores if s.named]
    brier = np.mean([(s.probability - s.top1) ** 2 for s in named]) if named else float("nan")
    note = f"Over all scenarios in which a name was given, whatever was hidden. Brier score {brier:.3f} (0 is best)."
    return Table(
        "Are the stated probabilities right?", ["stated", "mean", "first name right"], rows, note
    )


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
