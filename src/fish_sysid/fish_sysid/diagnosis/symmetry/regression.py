# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Symmetry tests by regression: whether further terms predict the trials that took no part in the fit.

Ordinary least squares without a ridge, on columns of unit length; directions that the columns hardly span are left out.
Standard errors are those of the jackknife over trials (Efron 1982), as residuals of one trial are correlated:

    std^2 = (M - 1) / M * sum over m of (b without trial m - their mean)^2
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import sem
from scipy.stats import t as student

from fish_sysid.diagnosis.symmetry.finding import (
    Estimate,
    Evidence,
    SymmetryFinding,
    SymmetryTest,
)
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, Trials
from fish_sysid.estimation.thresholds import (
    FEWEST_TRIALS,
    LEAST_OWN_SHARE,
    NEARLY_COLLINEAR,
    SMALLEST_SQUARE,
    SMALLEST_Z,
    SYMMETRY_LEVEL,
)

Array = NDArray[np.float64]
Conclusion = tuple[bool, str, Mapping[str, Estimate]]  # found, its statement, parameters


@dataclass(frozen=True)
class Rows:
    """Rows of the regression from one trial."""

    base: Array  # (N, P) columns of both models
    terms: Array  # (N, K) columns of the model with the terms
    measured: Array  # (N,)


@dataclass(frozen=True)
class Judged:
    """Coefficients of the model with the terms, and what the terms are worth on left-out trials."""

    coefficients: Array  # (P + K,), of the base columns and of the terms
    std: Array  # (P + K,)
    evidence: Evidence
    own_share: float  # smallest share of a combination of terms that the base columns do not span
    term_share: float  # the same of single terms, which may be alike among each other

    def stands(self, gain: float, *at: int) -> bool:
        """Whether trials are predicted better by more than `gain`, and a coefficient at one of these indices is sure."""
        sure = max(abs(self.coefficients[i]) - SMALLEST_Z * self.std[i] for i in at) > 0.0
        return sure and self.evidence.gain > gain and self.evidence.p_value < SYMMETRY_LEVEL

    def estimate(self, at: int, unit: str) -> Estimate:
        """Coefficient `at` with its standard error."""
        return Estimate(float(self.coefficients[at]), float(self.std[at]), unit)


@dataclass(frozen=True, kw_only=True)
class RegressionTest(SymmetryTest):
    """A symmetry test on stroke means: the terms of its regression are what breaks the symmetry."""

    rows: Callable[[StrokeMeans], Rows]  # of the regression, from one trial
    conclude: Callable[[Judged, Trials], Conclusion]
    usable: Callable[[Trials], Trials] = tuple  # trials that have what the rows need
    few: Callable[[int], str] = lambda _: "fewer than three usable trials"  # by how many there are
    lacking: Callable[[Trials], str] = lambda _: ""  # why usable trials cannot tell, "" if they can
    spanned: str = ""  # why they cannot where the base columns span all of the terms but a share {}
    one_by_one: bool = (
        False  # whether that share is of single terms, which may be alike among each other
    )

    def find(self, trials: Trials) -> SymmetryFinding:
        """The answer of these trials."""
        trials = self.usable(trials)
        if len(trials) < FEWEST_TRIALS:
            return self.cannot_tell(self.few(len(trials)))
        if reason := self.lacking(trials):
            return self.cannot_tell(reason)
        judged = judge([self.rows(trial) for trial in trials])
        share = judged.term_share if self.one_by_one else judged.own_share
        if share < LEAST_OWN_SHARE:
            return self.cannot_tell(self.spanned.format(share))
        return self.answer(*self.conclude(judged, trials), judged.evidence)


def judge(trials: Sequence[Rows]) -> Judged:
    """Fit with and without the terms, every trial left out in turn.

    Raises ValueError for fewer than three trials.
    """
    if len(trials) < FEWEST_TRIALS:
        raise ValueError(f"got {len(trials)} trials; expected at least {FEWEST_TRIALS}")
    both = [np.column_stack([rows.base, rows.terms]) for rows in trials]
    measured = [rows.measured for rows in trials]
    without = [_left_out([rows.base for rows in trials], measured, m)[1] for m in range(len(both))]
    fits = [_left_out(both, measured, m) for m in range(len(both))]
    left_out = np.array([b for b, _ in fits])
    gains = np.log(np.array(without) / np.array([square for _, square in fits]))
    whole = least_squares(np.concatenate(both), np.concatenate(measured))
    return Judged(whole, jackknife(left_out), evidence(gains), *own_shares(trials))


def _left_out(columns: Sequence[Array], measured: Sequence[Array], m: int) -> tuple[Array, float]:
    """Coefficients without trial m, and the mean square of its residuals."""
    kept = [i for i in range(len(columns)) if i != m]
    fit = least_squares(
        np.concatenate([columns[i] for i in kept]), np.concatenate([measured[i] for i in kept])
    )
    square = float(np.mean((measured[m] - columns[m] @ fit) ** 2))
    return fit, max(square, SMALLEST_SQUARE)


def least_squares(columns: Array, measured: Array) -> Array:
    """Coefficients (P,) of columns (N, P); zero along directions that the unit columns hardly span."""
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 0.0, length, 1.0)
    solved = np.linalg.lstsq(columns / length, measured, rcond=NEARLY_COLLINEAR)[0]
    return np.asarray(solved / length)


def jackknife(left_out: Array) -> Array:
    """Standard errors (K,) from estimates (M, K), each without one trial."""
    spread = ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
    return np.asarray(np.sqrt((len(left_out) - 1) / len(left_out) * spread))


def evidence(gains: Array) -> Evidence:
    """Mean, standard error and one-sided p value of log gains (M,) of left-out trials."""
    mean, std = float(gains.mean()), float(sem(gains))
    if not np.isfinite(mean):
        return Evidence(mean, std, 1.0)
    p = float(student.sf(mean / std, len(gains) - 1)) if std > 0.0 else float(mean <= 0.0)
    return Evidence(mean, std, p)


def own_shares(trials: Sequence[Rows]) -> tuple[float, float]:
    """1 where the base columns span nothing of the terms, 0 where they span a combination of them, and a single one."""
    base = np.concatenate([rows.base for rows in trials])
    terms = np.concatenate([rows.terms for rows in trials])
    length = np.linalg.norm(terms, axis=0)
    if not (length > 0.0).all():
        return 0.0, 0.0
    unit = terms / length
    rest = unit - base @ np.column_stack([least_squares(base, column) for column in unit.T])
    gram = rest.T @ rest
    return float(np.linalg.eigvalsh(gram)[0]), float(np.diag(gram).min())
