# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which name: what each candidate is worth on NEW's trials left out in turn, its strengths, and which of two predicts better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, sem
from scipy.stats import t as student

from fish_sysid.diagnosis.change.shared_fit import CHANGE, Key, Regression
from fish_sysid.diagnosis.change.swap_test import Gains

Array = NDArray[np.float64]


# probability that chance lets a contender lead by more than one that predicts clearly better: two normal standard errors
SEPARATE = float(norm.sf(2.0))


def apart(best: Array, other: Array) -> bool:
    """Whether the best predicts left-out trials clearly better: nats (M,) on each, Student's t as in `tie`."""
    return _lead(best, other) > float(student.isf(SEPARATE, len(best) - 1))


def tie(best: Array, other: Array) -> float:
    """Weight of a contender against the best one by nats (M,): 1 for equal gains, small for one that predicts worse.

    The two-sided probability of the lead by Student's t with M - 1 degrees of freedom, as M trials say how far trials differ.
    """
    return float(2.0 * student.sf(max(_lead(best, other), 0.0), len(best) - 1))


def _lead(best: Array, other: Array) -> float:
    """Mean difference of gains on left-out trials in its standard errors."""
    mean, std = mean_gain(best - other)
    return mean / max(std, 1e-9) if mean else 0.0


def mean_gain(gains: Array) -> tuple[float, float]:
    """Mean of (M,) and its standard error."""
    return float(gains.mean()), float(sem(gains))


# a name whose special case explains as much is not needed
SPECIAL_CASE = {"nonuniform_current": "current", "wake_memory": "tip_slip"}


@dataclass(frozen=True)
class Judged:
    """One candidate in NEW alone."""

    key: Key
    gain: float  # nats per left-out trial, mean
    by_trial: Array  # (M,)
    strengths: Array  # (K,) in typical ones
    covariance: Array  # (K, K), by the jackknife over trials, of NEW less OLD
    whole: float  # nats on the trials that it was fitted to
    dispersion: float  # by which all these nats are divided

    @property
    def name(self) -> str:
        return self.key[0]

    @property
    def nats(self) -> Array:
        """On each of NEW's trials (M,), left out, not divided by the dispersion.

        Two explanations of the same trials are told apart by the spread of their difference, which has all dispersion in it.
        """
        return self.by_trial * self.dispersion


def judge_all(fit: Regression, taken: Sequence[Key] = ()) -> dict[str, Judged]:
    """Every candidate beside those `taken`, the best form of each."""
    new = range(fit.old, len(fit.names))
    base = _Fitter(fit, [i for k in taken for i in fit.at[k]])
    without = [base.loss(m, base.left_out(m)) for m in new]
    found: dict[str, Judged] = {}
    dispersion = Gains(fit, taken).dispersion()
    for key, own in dispersion.items():
        # what its special case adds up to, it does too
        least = dispersion.get((SPECIAL_CASE.get(key[0], ""), 0), 1.0)
        judged = _judge(fit, key, taken, np.array(without), new, base.best, max(own, least))
        if key[0] not in found or judged.whole > found[key[0]].whole:
            found[key[0]] = judged
    return found


def strength_of(fit: Regression, key: Key, taken: Sequence[Key] = ()) -> Array:
    """Strengths (K,) of one candidate in NEW beside those `taken`, in typical ones."""
    own = [i for k in (*taken, key) for i in fit.at[k]]
    return _Fitter(fit, own).coefficients[-len(fit.at[key]) :]


def _judge(
    fit: Regression,
    key: Key,
    taken: Sequence[Key],
    without: Array,
    new: Sequence[int],
    start: float,
    dispersion: float,
) -> Judged:
    own = [i for k in (*taken, key) for i in fit.at[k]]
    fitter, K = _Fitter(fit, own), len(fit.at[key])
    left_out = [fitter.left_out(m) for m in new]
    gains = without - np.array([fitter.loss(m, b) for m, b in zip(new, left_out, strict=True)])
    gains /= dispersion
    values = np.array([b[-K:] for b in left_out])
    spread = values - values.mean(axis=0)
    covariance = fit.of_difference * (len(new) - 1) / len(new) * spread.T @ spread
    return Judged(
        key, float(gains.mean()), gains, fitter.coefficients[-K:], covariance,
        (fitter.best - start) / dispersion, dispersion,
    )  # fmt: skip


class _Fitter:
    """Shared columns with some candidates in NEW."""

    def __init__(self, fit: Regression, own: Sequence[int]) -> None:
        self._fit, self._own = fit, list(own)
        self._S = fit.shared
        self._at = [*range(self._S), *self._own]
        new = slice(fit.old, None)
        self._G = fit.gram[new][:, self._at][:, :, self._at].sum(axis=0)
        self._h = fit.moment[new][:, self._at].sum(axis=0)
        self._G[: self._S, : self._S] += fit.gram[: fit.old, : self._S, : self._S].sum(axis=0)
        self._h[: self._S] += fit.moment[: fit.old, : self._S].sum(axis=0)
        prior = np.concatenate([fit.precision, np.full(len(self._own), 1.0 / CHANGE**2)])
        self._G += np.diag(prior)
        self.coefficients = np.linalg.solve(self._G, self._h)
        self.best = 0.5 * float(self._h @ self.coefficients)

    def left_out(self, m: int) -> Array:
        """Coefficients (S + K,) without NEW's trial m."""
        at = self._at
        G = self._G - self._fit.gram[m][np.ix_(at, at)]
        return np.linalg.solve(G, self._h - self._fit.moment[m][at])

    def loss(self, m: int, b: Array) -> float:
        """Half the weighted sum of squares of trial m with coefficients (S + K,)."""
        at = self._at
        square = self._fit.square[m] - 2.0 * b @ self._fit.moment[m][at]
        return 0.5 * float(square + b @ self._fit.gram[m][np.ix_(at, at)] @ b)
