# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How rare a statistic is among those of exchanged trials, also where it exceeds them all.

An F statistic of few trials has a tail that is a power law. Hill's estimate gives its exponent from the largest of the null (Hill
1975; for p-values of few exchanges Knijnenburg et al. 2009):

    P(X > x) = k / n (x / u)^(-1 / gamma),   gamma = mean of log(x_i / u) over the k values beyond u

One standard error of gamma is added, gamma / sqrt(k), as the exchanged sets share trials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TAIL = 0.2  # share of the null that makes the tail
FEWEST = 10  # values in it
SMALLEST = 1e-6  # of a statistic


@dataclass(frozen=True)
class Tails:
    """The null of several statistics (n, J), and its tails."""

    null: Array  # (n, J) in order of size
    threshold: Array  # (J,)
    gamma: Array  # (J,)

    @classmethod
    def of(cls, null: Array) -> Tails:
        """Tails of statistics (n, J). One that looks lighter than the median of them has the median one's exponent."""
        ordered = np.sort(np.maximum(null, SMALLEST), axis=0)
        k = tail_size(len(null))
        threshold = ordered[-k - 1]
        gamma = np.log(ordered[-k:] / threshold).mean(axis=0) * (1.0 + 1.0 / np.sqrt(k))
        return cls(ordered, threshold, np.maximum(np.maximum(gamma, np.median(gamma)), SMALLEST))

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
