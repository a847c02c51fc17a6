# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a training run is made of; one dataclass, one YAML file (config/train.yaml) with the same keys."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from fish_control.policy_spec import OUTPUTS
from fish_report.errors import UserError
from fish_report.files import read_yaml
from fish_sim.model import DT
from fish_train.training.batch import LONGEST_DELAY
from fish_train.training.closed_loop_equations import COST_NAMES


@dataclass(frozen=True)
class TrainConfig:
    """The default recipe: the paper's curriculum, batch, unroll and optimiser."""

    # optimisation
    batch: int = 8  # fish
    unroll: int = 15  # environment steps through which one gradient goes
    hold: int = 10  # control periods (20 ms) in an environment step, for which the gains are kept
    learning_rate: float = 1e-3  # of Adam
    clip: float = 1.0  # largest norm of the gradient
    max_updates: int = 20_000  # stop here if the curriculum is not finished
    polish_updates: int = (
        2_000  # after the last level: all levels at once, learning rate falling to a tenth
    )
    # stage cost: weights of heading [1/rad^2], speed [s^2/m^2], cross-track [1/m^2], change of the set-points in
    # a control period, gains and change of gains as shares of their ranges
    cost_heading: float = 0.5
    cost_speed: float = 20.0
    cost_cross_track: float = 200.0
    cost_setpoint_change: float = 2.0
    cost_gain_size: float = 0.0005
    cost_gain_change: float = 0.05
    # curriculum
    amplitudes: tuple[float, ...] = (1.0, 1.5)  # m, of the sinusoids
    cycles: tuple[float, ...] = (0.5, 1.0, 2.0)  # over sinusoid_length
    sinusoid_length: float = 10.0  # m along x; the paper does not say
    radii: tuple[float, ...] = (1.5, 1.4, 1.3, 1.2, 1.1, 1.0)  # m, of the circles
    thresholds: tuple[float, ...] = (
        0.03,
        0.01,
    )  # m, mean |cross-track| that passes a level; one pass for each
    slowest: float = 0.1  # m/s, wanted speeds are spread over this range in each batch
    fastest: float = 0.3  # m/s
    criterion_episodes: int = 4  # length of the sliding window, in episodes
    # episodes
    episode: float = 15.0  # s
    approach: float = 6.0  # s at the start of an episode that the criterion leaves out
    start_offset: float = 0.03  # m, std of the start's distance from the path
    start_heading: float = 0.1  # rad, std of the start's heading error
    start_rest: float = (
        0.05  # share of fish that start at rest; the others at 0.5 to 1 of the wanted speed
    )
    # robustness, all off in the default recipe
    randomise: float = (
        0.0  # relative half-width of drags, stiffness, inertias, added masses; effects stay
    )
    noise_position: float = 0.0  # m, std of what the loop sees
    noise_heading: float = 0.0  # rad
    noise_speed: float = 0.0  # m/s
    noise_rate: float = 0.0  # rad/s
    noise_time: float = 0.2  # s, its correlation time
    latency: float = 0.0  # s, largest age of what the loop sees; drawn for each fish
    # gains of the untrained policy
    start_steering_kp: float = 0.5
    start_steering_ki: float = 0.1
    start_steering_kd: float = 0.1
    start_speed_kp: float = 0.5
    start_speed_ki: float = 0.05
    start_speed_kd: float = 0.01

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, list):
                object.__setattr__(self, field.name, tuple(value))
        self._check_numbers()
        self._check_curriculum()
        for o in OUTPUTS:
            self._within(f"start_{o.name}", o.low, o.high)

    def _check_numbers(self) -> None:
        counts = (
            ("batch", 1, 4096),
            ("unroll", 1, 1000),
            ("hold", 1, 100),
            ("max_updates", 1, 10**9),
            ("polish_updates", 0, 10**9),
            ("criterion_episodes", 1, 1000),
        )
        for name, least, most in counts:
            if not isinstance(getattr(self, name), int) or isinstance(getattr(self, name), bool):
                raise UserError(f"{name}: got {getattr(self, name)!r}; expected a whole number")
            self._within(name, least, most)
        for name, low, high in (
            ("learning_rate", 1e-8, 1.0),
            ("clip", 1e-6, 1e6),
            ("episode", 1.0, 600.0),
            ("approach", 0.0, 600.0),
            ("start_offset", 0.0, 0.2),
            ("start_heading", 0.0, 1.0),
            ("start_rest", 0.0, 1.0),
            ("randomise", 0.0, 0.9),
            ("noise_position", 0.0, 0.5),
            ("noise_heading", 0.0, 1.0),
            ("noise_speed", 0.0, 0.5),
            ("noise_rate", 0.0, 5.0),
            ("noise_time", 0.0, 10.0),
            ("latency", 0.0, LONGEST_DELAY * DT),
            *((f"cost_{name}", 0.0, 1e6) for name in COST_NAMES),
        ):
            self._within(name, low, high)
        if self.approach >= self.episode:
            raise UserError(
                f"approach: got {self.approach} s; expected less than an episode of {self.episode} s"
            )

    def _check_curriculum(self) -> None:
        for name, low, high in (
            ("amplitudes", 0.01, 5.0),
            ("cycles", 0.1, 10.0),
            ("radii", 0.2, 10.0),
            ("thresholds", 1e-4, 0.5),
        ):
            values = getattr(self, name)
            if not isinstance(values, tuple) or not values:
                raise UserError(f"{name}: got {values!r}; expected a list of numbers")
            for value in values:
                if not _is_number(value) or not low <= value <= high:
                    raise UserError(
                        f"{name}: got {value!r}; expected numbers in [{low:g}, {high:g}]"
                    )
        if list(self.thresholds) != sorted(self.thresholds, reverse=True):
            raise UserError(f"thresholds: got {self.thresholds}; expected falling numbers")
        self._within("slowest", 0.05, 0.5)
        self._within("fastest", 0.05, 0.5)
        self._within("sinusoid_length", 0.5, 50.0)
        if self.slowest > self.fastest:
            raise UserError(
                f"slowest: got {self.slowest} m/s; expected at most fastest, {self.fastest} m/s"
            )
        self._check_turns()

    def _check_turns(self) -> None:
        """Refuse sinusoids far tighter than a fish of this kind can turn."""
        for amplitude in self.amplitudes:
            for cycles in self.cycles:
                radius = 1.0 / (amplitude * (2.0 * math.pi * cycles / self.sinusoid_length) ** 2)
                if radius < TIGHTEST_TURN:
                    raise UserError(
                        f"amplitudes, cycles: a sinusoid of {amplitude} m with {cycles} cycles over "
                        f"{self.sinusoid_length} m turns within {radius:.2f} m; expected at least {TIGHTEST_TURN} m, "
                        "make sinusoid_length longer"
                    )

    def _within(self, name: str, low: float, high: float) -> None:
        value = getattr(self, name)
        if not _is_number(value) or not low <= value <= high:
            raise UserError(f"{name}: got {value!r}; expected a number in [{low:g}, {high:g}]")

    @property
    def cost(self) -> tuple[float, ...]:
        """Weights of the stage cost in the order of COST_NAMES."""
        return tuple(getattr(self, f"cost_{name}") for name in COST_NAMES)

    @property
    def start_gains(self) -> dict[str, float]:
        """Gains of the untrained policy by name."""
        return {o.name: getattr(self, f"start_{o.name}") for o in OUTPUTS}

    def to_plain(self) -> dict[str, Any]:
        """Plain types for YAML and JSON."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}


# the nominal fish turns in 0.26 m with its rudder hard over, other fish may turn tighter
TIGHTEST_TURN = 0.15  # m


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def make_config(values: Mapping[str, Any], where: str = "training recipe") -> TrainConfig:
    """A recipe from a table of values; an unknown name is refused with the known ones."""
    known = [f.name for f in fields(TrainConfig)]
    for name in values:
        if name not in known:
            raise UserError(f"{where}: unknown name {name!r}; known: {', '.join(known)}")
    return TrainConfig(**values)


def load_config(path: str | Path) -> dict[str, Any]:
    """The table of a YAML recipe; every key optional."""
    path = Path(path)
    try:
        content = read_yaml(path) or {}
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error
    if not isinstance(content, dict):
        raise UserError(f"{path}: got {type(content).__name__}; expected a table of name: value")
    return content
