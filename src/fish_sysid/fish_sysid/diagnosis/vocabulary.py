# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The names a diagnosis may answer with, and which of them the recordings can judge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import SENSOR_FIELDS, EffectTable
from fish_sysid.estimation.thresholds import LARGE_EFFECT, STILL

# the latent wrench itself; where the camera's point lies, which fits to predictions find
NOT_A_NAME = ("disturbance", "camera_marker")
SEEN_STILL = ("rudder_offset",)  # acts on a rudder whose command stays at zero
SEEN_MOVING = ("rudder_lag", "rudder_delay", "rudder_backlash")  # act when the command changes


class NoCandidateError(ValueError):
    """Nothing that competes can be judged on the recordings; the text says why."""


def candidates(effects: EffectTable = EFFECTS) -> tuple[str, ...]:
    """All names: every effect of the table, and the sensor errors that the filter models."""
    return (*(name for name in effects if name not in NOT_A_NAME), *SENSOR_FIELDS)


def known(names: Sequence[str], effects: EffectTable = EFFECTS) -> tuple[str, ...]:
    """The names, each once. Raises ValueError for one that is no candidate."""
    possible = candidates(effects)
    for name in names:
        if name not in possible:
            raise ValueError(f"unknown candidate {name!r}; known: {', '.join(possible)}")
    return tuple(dict.fromkeys(names))


def kind_of(name: str, effects: EffectTable = EFFECTS) -> str:
    """physics, actuator or sensor."""
    return "sensor" if name in SENSOR_EFFECTS else effects[name].kind


def choosable() -> tuple[str, ...]:
    """Effects that `identify --effects choose` looks for: all but maps of a pool's flow, which serve no other pool."""
    return tuple(
        name
        for name, effect in EFFECTS.items()
        if name not in NOT_A_NAME and len(effect.parameters) <= LARGE_EFFECT
    )


def not_judged(experiment: Experiment, robot: Robot) -> dict[str, str]:
    """Candidates about which this robot and these recordings say nothing, with the reason."""
    own = dict.fromkeys(
        (*robot.effects, *robot.sensors), "the given robot has it, and its values are refitted"
    )
    return not_excited(experiment, robot.table) | own


def not_excited(experiment: Experiment, effects: EffectTable = EFFECTS) -> dict[str, str]:
    """Candidates that these recordings do not excite, with the reason."""
    reasons: dict[str, str] = {}
    if not np.isfinite(experiment.gyro).any():
        reasons |= dict.fromkeys(("gyro_scale", "imu_misalignment"), "no IMU was recorded")
    rotor, rudder = experiment.given_commands.T
    if np.abs(rudder).max() < STILL:
        unseen = [name for name in effects if name.startswith("rudder_") and name not in SEEN_STILL]
        reasons |= dict.fromkeys(unseen, "the rudder never moved")
    elif np.ptp(rudder) < STILL:
        reasons |= dict.fromkeys(SEEN_MOVING, "the rudder's command never changed")
    if np.ptp(rotor) < STILL:
        unseen = ["rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"]
        reasons |= dict.fromkeys(unseen, "the rotor never moved")
    return reasons
