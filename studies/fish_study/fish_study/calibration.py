# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Are the stated probabilities right?"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fish_report.page import Table
from fish_study.score import Score
from fish_study.share import Share

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
