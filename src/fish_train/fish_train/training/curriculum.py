# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What swims in training: the ladder of paths, and the starts of its episodes.

Sinusoids and circles in turn, each passed when the cross-track error stays small enough. A start says where the fish are,
how fast they should swim, how their robots differ, what they see.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from fish_control.path_batch import TrackerConfig
from fish_control.paths import make_path
from fish_control.reference_path import ReferencePath
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper
from fish_train.training.batch import BatchState, PathBank
from fish_train.training.closed_loop_equations import CONTROL_PERIOD
from fish_train.training.config import TrainConfig

PHASES = 8  # sinusoids of a level, phases spread evenly over a turn
Array = NDArray[np.float64]
# what is weighed or measured with a ruler stays as it is
CERTAIN = (
    "head_mass",
    "hinge_offset",
    "link_length",
    "link_mass",
    "fin_length",
    "fin_mass",
    "servo_rate_limit",
    "rudder_range",
)
RUN_OUT = 0.5  # m of an open path that must be left at the end of an episode


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


class Episodes:
    """Draws the start of an episode for a bank of paths."""

    def __init__(
        self, config: TrainConfig, robot: Robot, stepper: Stepper, tracker: TrackerConfig
    ) -> None:
        self._config, self._stepper, self._tracker = config, stepper, tracker
        self._parameters = stepper.parameters(robot)
        # parameters of effects (`effect.parameter`) have ranges of their own, and places in the pool are no shares
        self._uncertain = np.array(
            [n not in CERTAIN and "." not in n for n in stepper.layout.parameters]
        )

    def start(self, bank: PathBank, rng: np.random.Generator) -> BatchState:
        """A batch, some at rest, most near the wanted speed, scattered about random places on random paths."""
        c, batch = self._config, self._config.batch
        path = rng.integers(len(bank), size=batch)
        share = (rng.permutation(batch) + rng.uniform(size=batch)) / batch
        speed = c.slowest + (c.fastest - c.slowest) * share
        progress = np.array(
            [
                rng.uniform(
                    0.0, bank.tables[k].length if bank.tables[k].closed else self._room(bank, k, v)
                )
                for k, v in zip(path, speed, strict=True)
            ]
        )
        poses = self._poses(bank, path, progress, rng)
        moving = rng.uniform(size=batch) >= c.start_rest
        surge = speed * moving * rng.uniform(0.5, 1.0, batch)
        plant = self._gliding(poses, surge)
        parameters = self._robots(batch, rng)
        seen = np.column_stack([poses, surge, np.zeros((batch, 2))])
        delay = rng.integers(round(c.latency / DT) + 1, size=batch)
        batch_state = BatchState.at(plant, parameters, path, speed, seen, delay)
        batch_state.place[:, [0, 2]] = progress[:, None]
        return batch_state

    def _room(self, bank: PathBank, k: int, speed: float) -> float:
        """Progress up to which an open path is long enough for an episode [m]."""
        return max(bank.tables[k].length - self._config.episode * speed * 1.2 - RUN_OUT, 0.0)

    def _poses(
        self, bank: PathBank, path: NDArray[np.int64], progress: Array, rng: np.random.Generator
    ) -> Array:
        """Poses (B, 3) beside the path."""
        points = np.array([bank.paths[k].point(s) for k, s in zip(path, progress, strict=True)])
        heading = np.array(
            [float(bank.paths[k].heading_at(s)) for k, s in zip(path, progress, strict=True)]
        )
        # beyond the capture distance progress would not start
        limit = 0.8 * self._tracker.capture_distance
        offset = np.clip(self._config.start_offset * rng.standard_normal(len(path)), -limit, limit)
        normal = np.column_stack([-np.sin(heading), np.cos(heading)])
        scatter = self._config.start_heading * rng.standard_normal(len(path))
        return np.column_stack([points + offset[:, None] * normal, heading + scatter])

    def _gliding(self, poses: Array, surge: Array) -> Array:
        """Plant states (B, NS) of straight fish that move ahead."""
        plant = np.array([self._stepper.rest(tuple(pose)) for pose in poses])
        size = self._stepper.layout.links + 3
        plant[:, size] = surge * np.cos(poses[:, 2])
        plant[:, size + 1] = surge * np.sin(poses[:, 2])
        return plant

    def _robots(self, batch: int, rng: np.random.Generator) -> Array:
        """Parameter vectors (B, NP); uncertain ones multiplied by 1 +- randomise, effects as they are."""
        if self._config.randomise == 0.0:
            return np.tile(self._parameters, (batch, 1))
        factors = rng.uniform(-1.0, 1.0, (batch, len(self._parameters))) * self._config.randomise
        robots: Array = self._parameters * (1.0 + factors * self._uncertain)
        return robots


class SeenNoise:
    """Errors of what the loop sees: first-order noise in every channel, continued from window to window."""

    def __init__(self, config: TrainConfig) -> None:
        c = config
        self._std = np.array(
            [c.noise_position] * 2 + [c.noise_heading] + [c.noise_speed] * 2 + [c.noise_rate]
        )
        self._kept = np.exp(-CONTROL_PERIOD / c.noise_time) if c.noise_time > 0.0 else 0.0
        self.state = np.zeros((c.batch, len(self._std)))

    def window(self, steps: int, rng: np.random.Generator) -> Array | None:
        """(steps + 1, B, 6); the last row is the first of the next window. None without noise."""
        if not self._std.any():
            return None
        rows = np.empty((steps + 1, *self.state.shape))
        for t in range(steps + 1):
            rows[t] = self.state
            if t < steps:
                fresh = (
                    np.sqrt(1.0 - self._kept**2) * self._std * rng.standard_normal(self.state.shape)
                )
                self.state = self._kept * self.state + fresh
        return rows

    def reset(self, rng: np.random.Generator) -> None:
        """Draw anew for an episode."""
        if self._std.any():
            self.state = self._std * rng.standard_normal(self.state.shape)
