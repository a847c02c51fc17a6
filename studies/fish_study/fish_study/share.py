# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How many of how many, with an exact interval."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from statsmodels.stats.proportion import proportion_confint

Item = TypeVar("Item")


@dataclass(frozen=True)
class Share:
    """k of n with its exact (Clopper-Pearson) 95 % interval."""

    k: int
    n: int

    @classmethod
    def of(cls, items: Iterable[Item], what: Callable[[Item], bool]) -> Share:
        """How many of the items are so."""
        flags = [bool(what(item)) for item in items]
        return cls(sum(flags), len(flags))

    @property
    def value(self) -> float:
        """K / n; NaN without any."""
        return self.k / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 %."""
        if not self.n:
            return float("nan"), float("nan")
        low, high = proportion_confint(self.k, self.n, method="beta")
        return float(np.nan_to_num(low)), float(high)

    @property
    def wilson(self) -> str:
        """K/n with the 95 % interval of Wilson (1927)."""
        if not self.n:
            return "–"
        low, high = proportion_confint(self.k, self.n, method="wilson")
        return f"{self.k}/{self.n} ({low:.0%} to {high:.0%})"

    @property
    def short(self) -> str:
        """k/n alone."""
        return f"{self.k}/{self.n}" if self.n else "–"

    def __str__(self) -> str:
        if not self.n:
            return "–"
        low, high = self.interval
        return f"{self.k}/{self.n} = {self.value:.0%} ({low:.0%} to {high:.0%})"
