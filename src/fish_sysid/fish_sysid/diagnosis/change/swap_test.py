# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What in NEW is rare? Trials of OLD and NEW exchanged at random: what a candidate gains then is the null.

Each name has a statistic of its own, whose rarity is that among exchanged trials. The rarest name counts, and how rare that is
among the rarest of exchanged trials is the p-value (Westfall and Young 1993, min-p): by its count, or by the tail where that is
less. An exchanged set that keeps most of NEW's trials looks as changed as NEW does and is no null: of a change it would say how
little the trials weigh that it leaves out. Sets that share more trials with NEW than random sets do in the mean take no part, and
`permutation_test` says at which level such p-values stand.

How rare a statistic is that exceeds them all: an F statistic of few trials has a tail that is a power law. Hill's estimate
gives its exponent from the largest of the null (Hill 1975; for p-values of few exchanges Knijnenburg et al. 2009):

    P(X > x) = k / n (x / u)^(-1 / gamma),   gamma = mean of log(x_i / u) over the k values beyond u

One standard error of gamma is added, gamma / sqrt(k), as the exchanged sets share trials.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.shared_fit import CHANGE, Key, Regression

Array = NDArray[np.float64]
Index = NDArray[np.int64]


TAIL = 0.2  # share of the null that makes the tail
FEWEST = 10  # values in it
LEAST_STATISTIC = 1e-6


@dataclass(frozen=True)
class Tails:
    """The null of several statistics (n, J), and its tails."""

    null: Array  # (n, J) in order of size
    threshold: Array  # (J,)
    gamma: Array  # (J,)

    @classmethod
    def of(cls, null: Array) -> Tails:
        """Tails of statistics (n, J). One that looks lighter than the median of them has the median one's exponent."""
        ordered = np.sort(np.maximum(null, LEAST_STATISTIC), axis=0)
        k = tail_size(len(null))
        threshold = ordered[-k - 1]
        gamma = np.log(ordered[-k:] / threshold).mean(axis=0) * (1.0 + 1.0 / np.sqrt(k))
        return cls(
            ordered, threshold, np.maximum(np.maximum(gamma, np.median(gamma)), LEAST_STATISTIC)
        )

    def probability(self, values: Array) -> Array:
        """Probabilities (Q, J) of at least `values` (Q, J), beyond 1 / n by the tail."""
        n = len(self.null)
        below = np.column_stack(
            [np.searchsorted(x, v, side="left") for x, v in zip(self.null.T, values.T, strict=True)]
        )
        beyond = np.maximum(values, self.threshold) / self.threshold
        by_tail = tail_size(n) / n * beyond ** (-1.0 / self.gamma)
        return np.where(values > self.threshold, by_tail, (1.0 + n - below) / (1.0 + n))


def tail_size(n: int) -> int:
    """How many of n values make the tail. Raises ValueError where they are too few."""
    if n <= FEWEST:
        raise ValueError(f"got a null of {n} values; expected more than {FEWEST}")
    return max(FEWEST, round(TAIL * n))


def tail_probability(null: Array, value: float) -> float:
    """Probability of at least `value` where the statistic without a change has been (n,)."""
    return float(Tails.of(null[:, None]).probability(np.array([[value]]))[0, 0])


REMAINDER = 0.005  # p-value up to which there is something left to name
SWAPS = 300
TRIES = 6  # draws for each set that is wanted
SMALLEST = 0.5  # nats of one trial


@dataclass(frozen=True)
class Swapped:
    """What the test says."""

    p_value: float
    rarity: dict[str, float]  # of a name's F in NEW among those of exchanged trials, - log p
    of_exchanged: Array  # (sets,) what the p-value is of exchanged trials
    of_days: float  # share of OLD's single days that look as changed as NEW; 0 where OLD is one day


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
    gains = Gains(fit, taken)
    null = gains.of(exchanges(strata, gains.new, random, swaps))
    tails = Tails.of(null)
    counts = [not n.startswith(PARAMETER) for n in gains.names]

    def rarest(values: Array) -> Array:
        return np.asarray(1.0 / tails.probability(values)[:, counts].min(axis=1))

    observed = gains.of([gains.new])
    of_null, of_new = rarest(null), float(rarest(observed)[0])
    counted = (1.0 + float((of_null >= of_new).sum())) / (1.0 + len(of_null))
    p = min(counted, tail_probability(of_null, of_new))
    share = share_of_days(lambda some: rarest(gains.of(some)), days, fit.old, of_new)
    rarity = -np.log(tails.probability(observed)[0])
    return Swapped(
        max(p, share),
        dict(zip(gains.names, rarity.tolist(), strict=True)),
        Tails.of(of_null[:, None]).probability(of_null[:, None])[:, 0],
        share,
    )


def at_once(tests: Sequence[Swapped]) -> float:
    """The p-value of several tests of the same exchanged trials together: how rare the smallest of their p-values is (min-p)."""
    smallest = 1.0 / np.min([test.of_exchanged for test in tests], axis=0)
    seen = min(tests, key=lambda test: test.p_value)
    counted = (1.0 + float((smallest >= 1.0 / seen.p_value).sum())) / (1.0 + len(smallest))
    return max(min(counted, tail_probability(smallest, 1.0 / seen.p_value)), seen.of_days)


def exchanges(
    strata: Sequence[int], new: Index, random: np.random.Generator, count: int
) -> list[Index]:
    """Up to `count` different sets of trials that stand for NEW, as many of each stratum as NEW has.

    None shares more trials with NEW than random sets do in the mean, or than one.
    """
    found, most = {}, most_shared(strata, new)
    for rows in drawn(strata, new, random, TRIES * count):
        if np.isin(rows, new).sum() <= most:
            found[rows.tobytes()] = rows
        if len(found) == count:
            break
    return list(found.values())


def drawn(
    strata: Sequence[int], new: Index, random: np.random.Generator, count: int
) -> Iterator[Index]:
    """`count` random sets of trials in their order, as many of each stratum as NEW has; a set may come twice."""
    kinds = np.asarray(strata)
    for _ in range(count):
        chosen = []
        for kind in np.unique(kinds[new]):
            wanted = int((kinds[new] == kind).sum())
            chosen.append(random.permutation(np.flatnonzero(kinds == kind))[:wanted])
        yield np.sort(np.concatenate(chosen))


def most_shared(strata: Sequence[int], new: Index) -> int:
    """How many trials random sets share with NEW in the mean, one at least."""
    kinds = np.asarray(strata)
    some = np.unique(kinds[new])
    return max(1, int(sum((kinds[new] == k).sum() ** 2 / (kinds == k).sum() for k in some)))


def single_days(days: Sequence[int], old: int) -> list[Index]:
    """The trials of each day of OLD, whose trials come first; none where OLD is one day."""
    of_old = np.asarray(days, dtype=np.int64)[:old]
    found = [np.flatnonzero(of_old == day) for day in np.unique(of_old)]
    return found if len(found) > 1 else []


def share_of_days(
    statistic: Callable[[Sequence[Index]], Array], days: Sequence[int], old: int, of_new: float
) -> float:
    """Share of OLD's single days that look as changed as NEW does; 0 where OLD is one day.

    statistic: (sets,) of sets of trials that stand for NEW; of_new: that of NEW itself. A change is larger than that from any
    of these days to the others, so that this share is the least that its p-value is.
    """
    some_days = single_days(days, old)
    return float((statistic(some_days) >= of_new).mean()) if some_days else 0.0


class Gains:
    """What each name gains when it acts in some trials alone, beside what is shared and the names taken."""

    def __init__(self, fit: Regression, taken: Sequence[Key]) -> None:
        keys = [k for k in fit.at if k not in taken]
        self.names = tuple(dict.fromkeys(name for name, _ in keys))
        self._trials = len(fit.names)
        self.new = np.arange(fit.old, self._trials)
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
            self._columns.append((key, _Column(both, own, fit.moment[:, i], inverse, right)))

    def of(self, sets: Sequence[Index]) -> Array:
        """F (sets, names) of `_Column`, the best form of each."""
        chosen = np.zeros((len(sets), self._trials))
        for row, rows in zip(chosen, sets, strict=True):
            row[rows] = 1.0
        best = {name: np.zeros(len(sets)) for name in self.names}
        for (name, _), column in self._columns:
            best[name] = np.maximum(best[name], column.ratio(chosen))
        return np.column_stack(list(best.values()))

    def dispersion(self) -> dict[Key, float]:
        """How much more OLD's trials differ along what each candidate is in NEW than noise lets them, 1 at least.

        The mean of chi squared of one degree of freedom each (McCullagh and Nelder 1989, 4.5).
        """
        chosen = np.isin(np.arange(self._trials), self.new).astype(float)
        old = self._trials - len(self.new)
        return {
            key: max(1.0, float(column.dispersion(chosen)[:old].mean()))
            for key, column in self._columns
        }


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

    def ratio(self, chosen: Array) -> Array:
        """(sets,) gain [nats] when it acts in the trials of a set over the mean of what is left of each trial, SMALLEST at least.

        chosen (sets, M): 1 for the trials of a set.
        """
        score, strength, left = self._fitted(chosen)
        each = 0.5 * np.einsum("nmi,mij,nmj->nm", left, self._each, left)
        gain = 0.5 * np.einsum("ni,ni->n", score, strength)
        return np.asarray(gain / np.maximum(each.mean(axis=1), SMALLEST))

    def dispersion(self, chosen: Array) -> Array:
        """(M,) squares of what is left of each trial along the strength of the trials chosen (M,), over those of noise."""
        _, (strength,), (left,) = self._fitted(chosen[None])
        noise = np.einsum("i,mij,j->m", strength, self._own + self._prior, strength)
        return np.asarray((left @ strength) ** 2 / np.maximum(noise, 1e-12))

    def _fitted(self, chosen: Array) -> tuple[Array, Array, Array]:
        """Score and strength (sets, K) of the trials of each set, and the score that is left of each trial (sets, M, K)."""
        B = np.einsum("nm,mib->nib", chosen, self._both)
        W = B @ self._inverse
        score = chosen @ self._score
        own = np.einsum("nm,mij->nij", chosen, self._own)
        own = own - W @ B.transpose(0, 2, 1) + self._prior
        strength = np.linalg.solve(own, score[..., None])[..., 0]
        shared = np.einsum("nib,ni->nb", W, strength)
        left = self._score + np.einsum("mib,nb->nmi", self._both, shared)
        left -= chosen[..., None] * np.einsum("mij,nj->nmi", self._own, strength)
        return score, strength, left
