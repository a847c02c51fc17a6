# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Is NEW different, at the level that is asked? NEW's rank among sets of trials that stand in its place.

`swap_test` says how rare what NEW shows is among sets that share few trials with NEW. That is powerful, and small too often where
nothing changed: these sets lack whatever single trials of NEW are odd. Here the same is asked of every set of trials in NEW's
place, each against the sets that share few trials with it. Where nothing changed NEW is one of these sets at random, and its rank
is an exact p-value (Lehmann and Romano 2005, 15.2). Of several looks the smallest p-value counts, ranked in the same way (min-p).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.shared_fit import Regression
from fish_sysid.diagnosis.change.swap_test import TRIES, Gains, Index, drawn, most_shared
from fish_sysid.diagnosis.change.tail_probability import Tails

Array = NDArray[np.float64]

SETS = 500


def permutation_p_value(
    looks: Sequence[Regression], strata: Sequence[int], count: int = SETS, seed: int = 0
) -> float:
    """The p-value of all looks together. strata (M,): trials are exchanged within them; OLD's come first, then NEW's."""
    new = np.arange(looks[0].old, len(looks[0].names))
    sets = sets_in_place(strata, new, np.random.default_rng(seed), count)
    near = shared(sets, len(looks[0].names)) > most_shared(strata, new)
    ranks = [rank(surprises(_named_gains(fit, sets), near)) for fit in looks]
    smallest = np.min(ranks, axis=0)
    return float((smallest <= smallest[0]).mean())


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


def surprises(gains: Array, near: NDArray[np.bool_]) -> Array:
    """(S,) - log p of the rarest name of each set: gains (S, J), against the sets that are not near (S, S) it."""
    return np.array(
        [
            -np.log(Tails.of(gains[~near[s]]).probability(gains[[s]])[0].min())
            for s in range(len(gains))
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
