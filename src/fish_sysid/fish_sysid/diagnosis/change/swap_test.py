# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Is NEW different? Trials of OLD and NEW exchanged at random: what a candidate gains then is the null.

The statistic is the largest gain over all names, each relative to what it gains when trials are exchanged. A trial that is
changed and counts as OLD makes that null wider, so that few trials need a strong change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.shared_fit import CHANGE, Key, Regression

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SWAPS = 300
USUAL = 0.9  # quantile of exchanged trials' gains that a gain is compared with
SMALLEST = 0.5  # nats of one trial
LEAST_USUAL = 0.1


@dataclass(frozen=True)
class Swapped:
    """What the test says."""

    p_value: float
    ratio: dict[
        str, float
    ]  # of a name's F in NEW to the USUAL quantile of that of exchanged trials


def swap_test(
    fit: Regression,
    strata: Sequence[int],
    swaps: int = SWAPS,
    seed: int = 0,
    taken: Sequence[Key] = (),
    days: Sequence[int] = (),
) -> Swapped:
    """strata (M,): trials are exchanged within them; taken: candidates that NEW has beyond doubt, in the null too.

    days (M,): of several days of OLD the number of each trial's day. Each day of OLD then stands for NEW in turn, and a change
    must be larger than that from any of these days to the others.
    """
    random = np.random.default_rng(seed)
    gains = _Gains(fit, taken)
    observed = gains.of(gains.new)
    null = np.array([gains.of(rows) for rows in exchanges(strata, gains.new, random, swaps)])
    usual = np.maximum(np.quantile(null, USUAL, axis=0), LEAST_USUAL)
    asked = np.array([not name.startswith(PARAMETER) for name in gains.names])
    largest = (observed / usual)[asked].max()
    under_null = (null / usual)[:, asked].max(axis=1)
    p = (1.0 + float((under_null >= largest).sum())) / (1.0 + len(null))
    of_days = np.array([gains.of(rows) for rows in single_days(days, fit.old)])
    if len(of_days):
        as_large = int(((of_days / usual)[:, asked].max(axis=1) >= largest).sum())
        p = max(p, as_large / len(of_days))
    return Swapped(p, dict(zip(gains.names, (observed / usual).tolist(), strict=True)))


def exchanges(
    strata: Sequence[int], new: Index, random: np.random.Generator, count: int
) -> list[Index]:
    """Up to `count` different sets of trials that stand for NEW, none NEW itself, as many of each stratum as NEW has."""
    kinds, found = np.asarray(strata), {}
    for _ in range(3 * count):
        chosen = []
        for kind in np.unique(kinds[new]):
            wanted = int((kinds[new] == kind).sum())
            chosen.append(random.permutation(np.flatnonzero(kinds == kind))[:wanted])
        rows = np.sort(np.concatenate(chosen))
        if not np.array_equal(rows, new):
            found[rows.tobytes()] = rows
        if len(found) == count:
            break
    return list(found.values())


def single_days(days: Sequence[int], old: int) -> list[Index]:
    """The trials of each day of OLD, whose trials come first; none where OLD is one day."""
    of_old = np.asarray(days, dtype=np.int64)[:old]
    found = [np.flatnonzero(of_old == day) for day in np.unique(of_old)]
    return found if len(found) > 1 else []


class _Gains:
    """What each name gains when it acts in some trials alone, beside what is shared and the names taken."""

    def __init__(self, fit: Regression, taken: Sequence[Key]) -> None:
        keys = [k for k in fit.at if k not in taken]
        self.names = tuple(dict.fromkeys(name for name, _ in keys))
        self.new = np.arange(fit.old, len(fit.names))
        S, fixed = fit.shared, np.array([i for k in taken for i in fit.at[k]], dtype=int)
        G, h = fit.gram.sum(axis=0)[:S, :S] + np.diag(fit.precision), fit.moment.sum(axis=0)[:S]
        N, g = fit.gram[self.new].sum(axis=0), fit.moment[self.new].sum(axis=0)
        cross, prior = N[:S, fixed], np.eye(len(fixed)) / CHANGE**2
        G = np.block([[G, cross], [cross.T, N[np.ix_(fixed, fixed)] + prior]])
        inverse, right = np.linalg.inv(G), np.concatenate([h, g[fixed]])
        is_new = np.isin(np.arange(len(fit.names)), self.new)
        self._columns = []
        for key in keys:
            i = fit.at[key]
            beside = fit.gram[:, i][:, :, fixed] * is_new[:, None, None]
            both = np.concatenate([fit.gram[:, i, :S], beside], axis=2)
            own = fit.gram[:, i][:, :, i]
            self._columns.append((key[0], _Column(both, own, fit.moment[:, i], inverse, right)))

    def of(self, rows: Index) -> Array:
        """F (names,) of `_Column`, the best form of each."""
        best = dict.fromkeys(self.names, 0.0)
        for name, column in self._columns:
            best[name] = max(best[name], column.ratio(rows))
        return np.array(list(best.values()))


class _Column:
    """One candidate: its gain in some trials against what it gains in each trial alone once that is taken out.

    The ratio is that of an analysis of variance with trials as units. A trial on the wrong side makes what is left of the
    trials larger, so that exchanged sets which share most trials with NEW do not look as changed as NEW does.
    """

    def __init__(
        self, both: Array, own: Array, moment: Array, inverse: Array, right: Array
    ) -> None:
        K = own.shape[1]
        self._both, self._own, self._inverse = both, own, inverse  # (M, K, B), (M, K, K), (B, B)
        self._score = moment - both @ (inverse @ right)  # (M, K)
        self._each = np.linalg.inv(own + np.eye(K) / CHANGE**2)
        self._prior = np.eye(K) / CHANGE**2

    def ratio(self, rows: Index) -> float:
        """Gain [nats] when it acts in the trials `rows` over the mean of what is left of each trial, SMALLEST at least."""
        B = self._both[rows].sum(axis=0)
        W = B @ self._inverse
        score = self._score[rows].sum(axis=0)
        strength = np.linalg.solve(self._own[rows].sum(axis=0) - W @ B.T + self._prior, score)
        left = self._score + self._both @ (W.T @ strength)
        left[rows] -= self._own[rows] @ strength
        each = 0.5 * np.einsum("mi,mij,mj->m", left, self._each, left)
        return 0.5 * float(score @ strength) / max(float(each.mean()), SMALLEST)
