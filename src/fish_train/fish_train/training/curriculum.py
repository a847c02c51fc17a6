# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ladder of paths: sinusoids and circles in turn, each passed when the cross-track error stays small enough."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from fish_control.paths import make_path
from fish_control.reference_path import ReferencePath
from fish_train.training.config import TrainConfig

PHASES = 8  # sinusoids of a level, phases spread evenly over a turn


@dataclass(frozen=True)
class Level:
    """One rung: a family of paths and the mean |cross-track| that passes it."""

    name: str
    family: str
    size: float  # m, amplitude or radius
    cycles: float  # of a sinusoid
    threshold: float  # m

    def paths(
        self, config: TrainConfig, rng: np.random.Generator, phases: int = PHASES
    ) -> list[ReferencePath]:
        """The paths of this level: sinusoids of random phase, circles in both directions."""
        if self.family == "circle":
            return [
                make_path("circle", radius=self.size, direction=direction) for direction in (1, -1)
            ]
        turns = (np.arange(phases) + rng.uniform()) / phases
        return [
            make_path(
                "sinusoid",
                amplitude=self.size,
                cycles=self.cycles,
                length=config.sinusoid_length,
                phase=float(2.0 * np.pi * turn),
            )
            for turn in turns
        ]


def make_levels(config: TrainConfig) -> list[Level]:
    """Growing sinusoids alternate with shrinking circles; the ladder is climbed once for each threshold."""
    levels: list[Level] = []
    for threshold in config.thresholds:
        sinusoids = [
            Level(
                f"sinusoid {amplitude:g} m x {cycles:g}, {threshold:g} m",
                "sinusoid",
                amplitude,
                cycles,
                threshold,
            )
            for amplitude in config.amplitudes
            for cycles in config.cycles
        ]
        circles = [
            Level(f"circle {radius:g} m, {threshold:g} m", "circle", radius, 0.0, threshold)
            for radius in config.radii
        ]
        levels += [
            level for pair in zip_longest(sinusoids, circles) for level in pair if level is not None
        ]
    return levels


class SlidingCriterion:
    """Mean |cross-track| of the last episodes, full only after as many as it is long."""

    def __init__(self, length: int, values: Sequence[float] = ()) -> None:
        self.values: deque[float] = deque(values, maxlen=length)

    def add(self, episode_mean: float) -> None:
        """One more episode [m]."""
        self.values.append(episode_mean)

    @property
    def mean(self) -> float:
        """Over the window [m]; nan before the first episode."""
        return float(np.mean(self.values)) if self.values else float("nan")

    def passed(self, threshold: float) -> bool:
        """Whether the window is full and its mean below the threshold [m]."""
        return len(self.values) == self.values.maxlen and self.mean < threshold
