# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The noise that an identification found, kept with the robot in robot.yaml, so that predictions use the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from typing import Any

from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.shooting.residuals import Scale
from fish_sysid.estimation.shooting.start_states import START_TRUST

STATES, NOISE, TRUST = "states", "noise", "trust"  # of Robot.prediction
STATES_BY_SHOOTING = "shooting"


def with_noise(robot: Robot, noise: Noise, states: str, trust: Scale = START_TRUST) -> Robot:
    """The robot with the noise of its filter, and how its states at start points are estimated: filter or shooting.

    trust: of shooting in the sensors.
    """
    table = {k: list(v) if isinstance(v, tuple) else float(v) for k, v in asdict(noise).items()}
    kept: dict[str, Any] = {STATES: states, NOISE: table}
    if states == STATES_BY_SHOOTING:
        kept[TRUST] = {k: float(v) for k, v in asdict(trust).items()}
    return replace(robot, prediction=kept)


def kept_trust(robot: Robot) -> Scale:
    """How far start states trust the sensors; raises UserError for numbers that cannot be used."""
    table: Mapping[str, Any] = robot.prediction.get(TRUST, {})
    known = tuple(f.name for f in fields(Scale))
    for name, value in table.items():
        good = isinstance(value, int | float) and math.isfinite(value) and value > 0.0
        if name not in known or not good:
            raise UserError(
                f"prediction.trust.{name}: got {value!r}; expected positive numbers under the names {', '.join(known)}; "
                "delete the entry for usual ones"
            )
    return replace(START_TRUST, **{k: float(v) for k, v in table.items()})


def kept_noise(robot: Robot) -> Noise | None:
    """The noise kept with a robot; None where there is none. Raises UserError for one that cannot be used."""
    table: Mapping[str, Any] = robot.prediction.get(NOISE, {})
    if not table:
        return None
    usual = asdict(Noise())
    for name, value in table.items():
        numbers = value if isinstance(value, list) else [value]
        size = len(usual[name]) if isinstance(usual.get(name), tuple) else 1
        good = all(isinstance(v, int | float) and math.isfinite(v) and v > 0.0 for v in numbers)
        if name not in usual or len(numbers) != size or not good:
            raise UserError(
                f"prediction.noise.{name}: got {value!r}; expected positive numbers under the names "
                f"{', '.join(f.name for f in fields(Noise))}; delete the entry to have the noise estimated anew"
            )
    kept: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else float(v) for k, v in table.items()
    }
    return replace(Noise(), **kept)


def uses_shooting(robot: Robot) -> bool:
    """Whether the robot's states at start points are estimated by shooting over the past second."""
    return bool(robot.prediction.get(STATES) == STATES_BY_SHOOTING)
