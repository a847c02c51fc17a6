# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Is NEW different, at the level that is asked? NEW's rank among sets of trials that stand in its place.

Each name has a statistic F_j (`swap_test.Gains`) of its own scale. A set S of trials in NEW's place shows

    T(S) = max over names j of both looks of F_j(S) / q_j(S)
    q_j(S): QUANTILE of F_j among the sets that share few trials with S, LEAST at least

so that a change is not compared with sets that have most of it. Where nothing changed NEW is one of these sets at random, and the
rank of T(NEW) is a p-value (Lehmann and Romano 2005, 15.2). It is exact but for what OLD alone settles: noise, ridge and the age
of the images.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.shared_fit import Regression
from fish_sysid.diagnosis.change.swap_test import (
    TRIES,
    Gains,
    Index,
    drawn,
    most_shared,
    share_of_days,
)

Array = NDArray[np.float64]

SETS = 500
QUANTILE = 0.9
LEAST = 1.0  # of F, which noise alone reaches; a name that does not act in most sets has less


def permutation_p_value(
    looks: Sequence[Regression],
    strata: Sequence[int],
    count: int = SETS,
    seed: int = 0,
    days: Sequence[int] = (),
) -> float:
    """The p-value of all names in all looks together.

    strata (M,): trials are exchanged within them; OLD's come first, then NEW's. days (M,): of several days of OLD the number of
    each trial's day. Each day of OLD then stands for NEW as well: the p-value is at least the share of days that show as much.
    """
    new = np.arange(looks[0].old, len(looks[0].names))
    sets = sets_in_place(strata, new, np.random.default_rng(seed), count)
    most, trials = most_shared(strata, new), len(looks[0].names)
    gains = _named_gains(looks, sets)
    of_sets = largest(gains, gains, shared(sets, sets, trials) > most)

    def of_days(some: Sequence[Index]) -> Array:
        common = shared(some, sets, trials)  # a large day shares many with every set
        near = common > np.maximum(most, common.mean(axis=1, keepdims=True))
        return largest(_named_gains(looks, some), gains, near)

    share = share_of_days(of_days, days, looks[0].old, of_sets[0])
    return max(float(rank(of_sets)[0]), share)


def p_value_of(
    statistic: Callable[[Index], float],
    strata: Sequence[int],
    new: Index,
    days: Sequence[int] = (),
    count: int = SETS,
) -> float:
    """The p-value of one number of a set of trials: NEW's rank among sets in its place, and at least `share_of_days`."""
    sets = sets_in_place(strata, new, np.random.default_rng(0), count)

    def of(some: Sequence[Index]) -> Array:
        return np.array([statistic(rows) for rows in some])

    of_sets = of(sets)
    return max(float(rank(of_sets)[0]), share_of_days(of, days, int(new[0]), of_sets[0]))


def sets_in_place(
    strata: Sequence[int], new: Index, random: np.random.Generator, count: int
) -> list[Index]:
    """NEW's own trials, then up to `count` other sets at random, as many of each stratum as NEW has."""
    found = {new.tobytes(): new}
    for rows in drawn(strata, new, random, TRIES * count):
        found[rows.tobytes()] = rows
        if len(found) > count:
            break
    return list(found.values())


def shared(some: Sequence[Index], others: Sequence[Index], trials: int) -> NDArray[np.int64]:
    """(A, B) how many trials each of some sets shares with each of others."""
    first, second = (
        np.array([np.isin(np.arange(trials), rows) for rows in sets], dtype=np.int64)
        for sets in (some, others)
    )
    return np.asarray(first @ second.T)


def largest(own: Array, gains: Array, near: NDArray[np.bool_]) -> Array:
    """T (A,) of sets with gains `own` (A, J), over the QUANTILE among the sets of `gains` (S, J) that are not near (A, S)."""
    usual = [np.quantile(gains[~close], QUANTILE, axis=0) for close in near]
    return np.asarray((own / np.maximum(usual, LEAST)).max(axis=1))


def rank(values: Array) -> Array:
    """(S,) the share of values that are as large as each."""
    order = np.sort(values)
    return np.asarray((len(values) - np.searchsorted(order, values, side="left")) / len(values))


def _named_gains(looks: Sequence[Regression], sets: Sequence[Index]) -> Array:
    """(S, J) F of the vocabulary's names in every look."""
    found = []
    for fit in looks:
        gains = Gains(fit, ())
        counts = [not name.startswith(PARAMETER) for name in gains.names]
        found.append(gains.of(sets)[:, counts])
    return np.hstack(found)
