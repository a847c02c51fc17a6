# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the oracle's scores: against the truth fitted, and competitors on the residual force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fish_report.files import number
from fish_report.page import Table
from fish_study.oracle import OracleResult, detects
from fish_study.score import Score
from fish_study.share import Share

HORIZON = 1  # index of 2 s among the oracle's horizons
# of other scenarios no structure that the oracle could fit is the true one
COMPARABLE = "the simulator's fish with three tail links, no vortex among them"


@dataclass(frozen=True)
class OracleScores:
    """The oracle's scores of all scenarios by seed."""

    scores: Mapping[int, Mapping[str, Any]]  # as in oracle.json
    fits: Mapping[int, OracleResult]  # where the oracle could fit
    detected: Mapping[int, bool]  # where something is hidden: whether the oracle detects it

    @classmethod
    def of(cls, answers: Sequence[Score], scores: Mapping[int, Mapping[str, Any]]) -> OracleScores:
        """With the threshold of the null scenarios among the answers."""
        fits = {
            seed: OracleResult.read(content["fits"])
            for seed, content in scores.items()
            if content.get("fits")
        }
        own = [s.scenario for s in answers if s.scenario.seed in fits]
        nulls = [fits[scenario.seed] for scenario in own if not scenario.names]
        detected = {
            scenario.seed: detects(fits[scenario.seed], nulls) for scenario in own if scenario.names
        }
        return cls(scores, fits, detected)


def oracle_table(scores: Sequence[Score], oracle: OracleScores) -> Table:
    """Against the truth fitted."""
    own = [s for s in scores if s.truth and s.scenario.seed in oracle.detected]
    clear = [s for s in own if oracle.detected[s.scenario.seed]]
    nameless = [s for s in scores if s.unnamed and oracle.detected.get(s.scenario.seed)]
    errors = [
        (_rms(s, "with_effects"), oracle.fits[s.scenario.seed])
        for s in own
        if s.exact and _rms(s, "with_effects")
    ]
    right = [oracle.scores[s.scenario.seed] for s in scores if s.top1]
    dof, times, regime, by_range = (
        _finite([content.get(key) for content in right])
        for key in ("dof", "overlap", "f1", "range_f1")
    )
    found = sum(s.in_set for s in clear) / len(clear) if clear else float("nan")
    unexplained = Share.of(nameless, lambda s: s.verdict == "unexplained")
    over_true = [error / fits.rms_true[HORIZON][0] for error, fits in errors]
    over_nominal = [error / fits.rms_nominal[HORIZON][0] for error, fits in errors]
    rows = [
        (
            "truth in the answered set where the oracle detects",
            "at least 90 %",
            f"{found:.0%} of {len(clear)}",
        ),
        (
            "unexplained where there is no name for what the oracle detects",
            "at least 85 %",
            str(unexplained),
        ),
        (
            "held-out position error at 2 s over that of the true structure fitted, median",
            "at most 1.1",
            _median(over_true),
        ),
        ("the same over the refitted nominal structure, median", "", _median(over_nominal)),
        (
            "degrees of freedom: overlap of their shares with those of the true structure fitted",
            "",
            _mean(dof),
        ),
        ("time overlap (IoU) of localised effects", "at least 0.7", _mean(times)),
        ("regime F1: the samples in which a localised effect acts", "at least 0.9", _mean(regime)),
        ("the same from the range of the one most telling covariate", "", _mean(by_range)),
    ]
    note = (
        "The oracle starts from the true values and knows the name; errors where exactly the hidden names were given. Only "
        f"{COMPARABLE}; a scenario without an answer counts as not right."
    )
    return Table(
        "Against the truth fitted", ["what", "asked", "measured"], [list(row) for row in rows], note
    )


def competitor_table(scores: Sequence[Score], oracle: OracleScores) -> Table:
    """Competitors on the residual force of the refitted nominal model."""
    given = {seed: s["competitors"] for seed, s in oracle.scores.items() if s.get("competitors")}
    own = [s for s in scores if s.scenario.seed in given and len(s.truth) < 2]
    named = {s.scenario.seed: given[s.scenario.seed]["sindy"] for s in own}
    hidden, nothing = [s for s in own if s.truth], [s for s in own if s.scenario.group == "null"]
    answers = [s for s in nothing if s.has_answer]
    sparse, neural = (
        _median(_finite([given[s.scenario.seed][key] for s in hidden]))
        for key in ("sindy_r2", "neural_r2")
    )
    right, alarms = (
        Share.of(hidden, lambda s: named[s.scenario.seed] in s.truth),
        Share.of(nothing, lambda s: named[s.scenario.seed] is not None),
    )
    rows = [
        [
            "this tool",
            str(Share.of(hidden, lambda s: s.top1)),
            str(Share.of(answers, lambda s: s.alarm)),
            "",
        ],
        ["PySINDy", str(right), str(alarms), sparse],
        ["neural network (fit only)", "gives none", "gives none", neural],
    ]
    header = [
        "on the residual force",
        "right name first",
        "false alarms",
        "R2 of that force, held out, median",
    ]
    note = (
        "The residual force is that of the oracle's refit of the nominal model. A law is a name by its largest term. Only "
        f"{COMPARABLE}, with one hidden name or none: fewer nulls than in the other tables. A scenario without an answer counts "
        "as not right, a null without one does not count for the tool."
    )
    return Table("Competitors on the residual force", header, rows, note)


def _rms(score: Score, model: str) -> float:
    """Held-out position error at 2 s [m]; 0 where not stated."""
    rows = score.rms.get(model, {})
    return number(rows.get("2 s", {}).get("position_m"), 0.0)


def _finite(values: Sequence[float | None]) -> list[float]:
    return [v for v in values if v is not None and np.isfinite(v)]


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f} ({len(values)} scenarios)" if values else "–"


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.2f} ({len(values)} scenarios)" if values else "–"
