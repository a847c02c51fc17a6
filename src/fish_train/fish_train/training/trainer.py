# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Backpropagation through time, window by window, up the ladder of levels; its whole state can be saved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.scheme import Scheme, default_scheme, stable_scheme
from fish_sim.step import Stepper
from fish_train.training.batch import BatchState, PathBank, WindowResult
from fish_train.training.closed_loop_equations import CONTROL_PERIOD, Law
from fish_train.training.compiled_loop import fastest_loop
from fish_train.training.config import TrainConfig
from fish_train.training.curriculum import Episodes, SeenNoise, SlidingCriterion, make_levels
from fish_train.training.network import FORMS, Form, initial_weights

Array = NDArray[np.float64]
POLISH_PHASES = 2  # sinusoids of each level while polishing


class TrainingDiverged(Exception):
    """Cost or gradient stopped being a number."""


@dataclass(frozen=True)
class Progress:
    """One row of the training curve, over the episode that just ended."""

    update: int
    environment_steps: int
    level: int  # number of levels passed
    name: str
    cost: float  # mean over the episode's windows
    cross_track: float  # m, mean |e| after the approach
    heading: float  # rad, likewise
    speed: float  # m/s, likewise
    criterion: float  # m, sliding window
    gradient_norm: float  # mean, before clipping
    gains: tuple[float, ...]  # mean over the episode


class Trainer:
    """One run: weights, optimiser, curriculum and the fish that swim now."""

    def __init__(
        self,
        config: TrainConfig,
        robot: Robot,
        seed: int,
        law: Law | None = None,
        weights: Array | None = None,
        form: Form = FORMS["network"],
    ) -> None:
        self.config, self.robot, self.seed, self.form = config, robot, seed, form
        self.law = replace(law or Law(), inputs=form.inputs)
        self.rng = np.random.default_rng(seed)
        self.levels = make_levels(config)
        self.level, self.update, self.polished = 0, 0, 0
        self.criterion = SlidingCriterion(config.criterion_episodes)
        self._stepper = Stepper(robot.structure, training_scheme(robot))
        self._episodes = Episodes(config, robot, self._stepper, self.law.tracker)
        self._noise = SeenNoise(config)
        start = (
            initial_weights(self.rng, config.start_gains, form.layers)
            if weights is None
            else np.array(weights)
        )
        self._flat = torch.from_numpy(start).requires_grad_(True)
        self._optimiser = torch.optim.Adam([self._flat], lr=config.learning_rate)
        self._window = config.unroll * config.hold  # control periods
        self._episode_windows = max(1, round(config.episode / (CONTROL_PERIOD * self._window)))
        self._approach = round(config.approach / CONTROL_PERIOD)
        self._loop = fastest_loop(self._stepper, self.law, self._make_bank(), form.layers)
        self._begin_episode()

    @property
    def weights(self) -> Array:
        """Flat weights, a copy."""
        return self._flat.detach().numpy().copy()

    def set_weights(self, weights: Array) -> None:
        """Replace the weights; the optimiser's memory stays."""
        with torch.no_grad():
            self._flat.copy_(torch.from_numpy(np.asarray(weights, dtype=float)))

    def ladder_bank(self) -> PathBank:
        """A few paths of every level."""
        rng = np.random.default_rng([self.seed, len(self.levels)])
        ladder = self.levels[: len(self.levels) // len(self.config.thresholds)]
        return PathBank(
            [p for level in ladder for p in level.paths(self.config, rng, POLISH_PHASES)],
            self.law.tracker,
        )

    def rollout_cost(
        self, weights: Array, batch_state: BatchState, bank: PathBank, noise: Array | None = None
    ) -> float:
        """Mean stage cost of an episode from a state of the batch on a bank's paths; the state is advanced."""
        self._loop.set_bank(bank)
        cost, hold = np.array(self.config.cost), self.config.hold
        result = self._loop.window(
            weights, batch_state, self._episode_steps, cost, noise, gradient=False, hold=hold
        )
        return result.cost

    @property
    def _episode_steps(self) -> int:
        """Control periods."""
        return self._episode_windows * self._window

    def draw_batch(self, bank: PathBank) -> BatchState:
        """The start of an episode."""
        return self._episodes.start(bank, self.rng)

    def draw_noise(self) -> Array | None:
        """Errors of what the fish see through an episode, for `rollout_cost`; None without noise."""
        self._noise.reset(self.rng)
        return self._noise.window(self._episode_steps, self.rng)

    @property
    def finished(self) -> bool:
        """Every level passed and the polish done."""
        return self.level >= len(self.levels) and self.polished >= self.config.polish_updates

    @property
    def passed_all(self) -> bool:
        """Every level passed."""
        return self.level >= len(self.levels)

    def _make_bank(self) -> PathBank:
        """Paths of the present level; of the whole ladder while polishing. Drawn from seed and level alone."""
        rng = np.random.default_rng([self.seed, self.level])
        if self.passed_all:
            return self.ladder_bank()
        return PathBank(self.levels[self.level].paths(self.config, rng), self.law.tracker)

    def _begin_episode(self) -> None:
        self.batch_state: BatchState = self._episodes.start(self._loop.bank, self.rng)
        self._noise.reset(self.rng)
        self._rows: list[tuple[Array, Array, float, float]] = []

    def step(self) -> Progress | None:
        """One update; at the end of an episode its row of the curve.

        Raises:
            TrainingDiverged: the weights are those before the bad update.
        """
        c = self.config
        noise = self._noise.window(self._window, self.rng)
        weights = self._flat.detach().numpy()
        result = self._loop.window(
            weights, self.batch_state, self._window, np.array(c.cost), noise, hold=c.hold
        )
        norm = self._descend(result)
        self.update += 1
        self.polished += self.passed_all
        self._rows.append(
            (np.abs(result.report[1:]).mean(axis=1), result.applied.mean(axis=1), result.cost, norm)
        )
        if len(self._rows) < self._episode_windows:
            return None
        progress = self._end_episode()
        self._begin_episode()
        return progress

    def end_episode_early(self) -> None:
        """Begin a new episode now, so that the state can be saved."""
        if self._rows:
            self._begin_episode()

    def _descend(self, result: WindowResult) -> float:
        """Clip and apply the gradient; its norm."""
        if (
            result.gradient is None
            or not np.isfinite(result.cost)
            or not np.all(np.isfinite(result.gradient))
        ):
            raise TrainingDiverged(f"cost {result.cost}")
        self._flat.grad = torch.from_numpy(result.gradient)
        norm = float(torch.nn.utils.clip_grad_norm_([self._flat], self.config.clip))
        for group in self._optimiser.param_groups:
            group["lr"] = self._learning_rate()
        self._optimiser.step()
        return norm

    def _learning_rate(self) -> float:
        """Constant up the ladder, then falling to a tenth."""
        c = self.config
        if not self.passed_all or c.polish_updates == 0:
            return c.learning_rate
        return float(c.learning_rate * 0.1 ** min(self.polished / c.polish_updates, 1.0))

    def _end_episode(self) -> Progress:
        """Judge the episode, move up if the level is passed."""
        errors = np.concatenate([row[0] for row in self._rows])
        after = errors[min(self._approach, len(errors) - 1) :].mean(axis=0)
        gains = np.concatenate([row[1] for row in self._rows]).mean(axis=0)
        self.criterion.add(float(after[0]))
        name = "polish" if self.passed_all else self.levels[self.level].name
        progress = Progress(
            update=self.update,
            environment_steps=self.update * self.config.batch * self.config.unroll,
            level=self.level,
            name=name,
            cost=float(np.mean([row[2] for row in self._rows])),
            cross_track=float(after[0]),
            heading=float(after[1]),
            speed=float(after[2]),
            criterion=self.criterion.mean,
            gradient_norm=float(np.mean([row[3] for row in self._rows])),
            gains=tuple(gains[:6]),
        )
        if not self.passed_all and self.criterion.passed(self.levels[self.level].threshold):
            self.level += 1
            self.criterion = SlidingCriterion(self.config.criterion_episodes)
            self._loop.set_bank(self._make_bank())
        return progress

    def state(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """(plain values, arrays) from which `restore` continues exactly; between episodes only."""
        if self._rows:
            raise RuntimeError(
                f"{len(self._rows)} windows into an episode; expected the start of one"
            )
        moments = self._optimiser.state.get(self._flat, {})
        plain = {
            "seed": self.seed,
            "update": self.update,
            "level": self.level,
            "polished": self.polished,
            "criterion": list(self.criterion.values),
            "random": self.rng.bit_generator.state,
            "optimiser_step": float(moments.get("step", 0.0)),
        }
        arrays = {f"batch_state.{name}": value for name, value in vars(self.batch_state).items()}
        arrays |= {"weights": self.weights, "noise": self._noise.state}
        for name in ("exp_avg", "exp_avg_sq"):
            if name in moments:
                arrays[name] = moments[name].numpy()
        return plain, {name: np.array(value) for name, value in arrays.items()}

    def restore(self, plain: dict[str, Any], arrays: dict[str, Array]) -> None:
        """Continue from a `state` of a run with the same recipe, robot and seed."""
        self.seed, self.update, self.level = plain["seed"], plain["update"], plain["level"]
        self.polished = plain["polished"]
        self.criterion = SlidingCriterion(self.config.criterion_episodes, plain["criterion"])
        self.rng.bit_generator.state = plain["random"]
        with torch.no_grad():
            self._flat.copy_(torch.from_numpy(arrays["weights"]))
        if "exp_avg" in arrays:
            moments = {k: torch.from_numpy(np.array(arrays[k])) for k in ("exp_avg", "exp_avg_sq")}
            self._optimiser.state[self._flat] = {
                "step": torch.tensor(plain["optimiser_step"]),
                **moments,
            }
        self._noise.state = np.array(arrays["noise"])
        self._loop.set_bank(self._make_bank())
        batch_state: dict[str, Any] = {
            k.removeprefix("batch_state."): v
            for k, v in arrays.items()
            if k.startswith("batch_state.")
        }
        self.batch_state = BatchState(**batch_state)
        self._rows = []


def training_scheme(robot: Robot) -> Scheme:
    """RK4 with half of the simulator's steps, one for up to three links, or as many as are stable for the robot.

    Its damping of the fastest tail mode does not matter to gains.
    """
    return stable_scheme(robot, Scheme("rk4", (default_scheme(robot.links).substeps + 1) // 2))
