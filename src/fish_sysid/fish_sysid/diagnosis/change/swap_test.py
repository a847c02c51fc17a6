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
LEAST_USUAL = 1.0  # nats


@dataclass(frozen=True)
class Swapped:
    """What the test says."""

    p_value: float
    gains: dict[str, float]  # nats of each name or parameter in NEW
    ratio: dict[str, float]  # of that gain to the USUAL quantile of exchanged trials


def swap_test(
    fit: Regression,
    strata: Sequence[int],
    swaps: int = SWAPS,
    seed: int = 0,
    taken: Sequence[Key] = (),
) -> Swapped:
    """strata (M,): trials are exchanged within them; taken: candidates that NEW has beyond doubt, in the null too."""
    random = np.random.default_rng(seed)
    gains = _Gains(fit, taken)
    observed = gains.of(gains.new)
    null = np.array([gains.of(rows) for rows in exchanges(strata, gains.new, random, swaps)])
    usual = np.maximum(np.quantile(null, USUAL, axis=0), LEAST_USUAL)
    asked = np.array([not name.startswith(PARAMETER) for name in gains.names])
    largest = (observed / usual)[asked].max()
    under_null = (null / usual)[:, asked].max(axis=1)
    p = (1.0 + float((under_null >= largest).sum())) / (1.0 + len(null))
    found = dict(zip(gains.names, observed.tolist(), strict=True))
    return Swapped(p, found, dict(zip(gains.names, (observed / usual).tolist(), strict=True)))


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


class _Gains:
    """What each name gains when it acts in some trials alone, beside what is shared and the names taken."""

    def __init__(self, fit: Regression, taken: Sequence[Key]) -> None:
        keys = [k for k in fit.at if k not in taken]
        self._at = [(k[0], fit.at[k]) for k in keys]
        self.names = tuple(dict.fromkeys(name for name, _ in self._at))
        self.new = np.arange(fit.old, len(fit.names))
        self._own = np.unique(np.concatenate([i for _, i in self._at]))
        self._place = {int(i): n for n, i in enumerate(self._own)}
        S, fixed = fit.shared, np.array([i for k in taken for i in fit.at[k]], dtype=int)
        G, h = fit.gram.sum(axis=0)[:S, :S] + np.diag(fit.precision), fit.moment.sum(axis=0)[:S]
        N, g = fit.gram[self.new].sum(axis=0), fit.moment[self.new].sum(axis=0)
        cross, prior = N[:S, fixed], np.eye(len(fixed)) / CHANGE**2
        G = np.block([[G, cross], [cross.T, N[np.ix_(fixed, fixed)] + prior]])
        self._inverse, self._h = np.linalg.inv(G), np.concatenate([h, g[fixed]])
        own = self._own
        self._with_shared, self._with_fixed = fit.gram[:, own, :S], fit.gram[:, own][:, :, fixed]
        self._gram, self._moment = fit.gram[:, own][:, :, own], fit.moment[:, own]

    def of(self, rows: Index) -> Array:
        """Nats (names,), the best form of each."""
        both = np.intersect1d(rows, self.new)
        B = np.hstack([self._with_shared[rows].sum(axis=0), self._with_fixed[both].sum(axis=0)])
        W = B @ self._inverse
        left = self._gram[rows].sum(axis=0) - W @ B.T
        score = self._moment[rows].sum(axis=0) - W @ self._h
        best = dict.fromkeys(self.names, 0.0)
        for name, columns in self._at:
            i = [self._place[int(c)] for c in columns]
            normal = left[np.ix_(i, i)] + np.eye(len(i)) / CHANGE**2
            gain = 0.5 * float(score[i] @ np.linalg.solve(normal, score[i]))
            best[name] = max(best[name], gain)
        return np.array(list(best.values()))
