# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Is NEW different, at the level that is asked? NEW's rank among sets of trials that stand in its place.

Each name has a statistic F_j (`swap_test.Gains`) of its own scale. A set S of trials in NEW's place shows

    T(S) = max over names j of both looks of F_j(S) / q_j(S)
    q_j(S): QUANTILE of F_j among the sets that share few trials with S

so that a change is not compared with sets that have most of it. Where nothing changed NEW is one of these sets at random, and the
rank of T(NEW) is an exact p-value (Lehmann and Romano 2005, 15.2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.shared_fit import Regression
from fish_sysid.diagnosis.change.swap_test import TRIES, Gains, Index, drawn, most_shared

Array = NDArray[np.float64]

SETS = 500
QUANTILE = 0.9


def permutation_p_value(
    looks: Sequence[Regression], strata: Sequence[int], count: int = SETS, seed: int = 0
) -> float:
    """The p-value of all names in all looks together.

    strata (M,): trials are exchanged within them; OLD's come first, then NEW's.
    """
    new = np.arange(looks[0].old, len(looks[0].names))
    sets = sets_in_place(strata, new, np.random.default_rng(seed), count)
    near = shared(sets, len(looks[0].names)) > most_shared(strata, new)
    gains = np.hstack([_named_gains(fit, sets) for fit in looks])
    return float(rank(largest(gains, near))[0])


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


def shared(sets: Sequence[Index], trials: int) -> NDArray[np.int64]:
    """(S, S) how many trials each two sets share."""
    chosen = np.zeros((len(sets), trials), dtype=np.int64)
    for row, rows in zip(chosen, sets, strict=True):
        row[rows] = 1
    return np.asarray(chosen @ chosen.T)


def largest(gains: Array, near: NDArray[np.bool_]) -> Array:
    """T (S,) of gains (S, J): the largest over its QUANTILE among the sets that are not near (S, S) it."""
    return np.array(
        [
            (own / np.quantile(gains[~near[s]], QUANTILE, axis=0)).max()
            for s, own in enumerate(gains)
        ]
    )


def rank(values: Array) -> Array:
    """(S,) the share of values that are as large as each."""
    order = np.sort(values)
    return np.asarray((len(values) - np.searchsorted(order, values, side="left")) / len(values))


def _named_gains(fit: Regression, sets: Sequence[Index]) -> Array:
    """(S, J) of the vocabulary's names."""
    gains = Gains(fit, ())
    counts = [not name.startswith(PARAMETER) for name in gains.names]
    return np.asarray(gains.of(sets)[:, counts])
