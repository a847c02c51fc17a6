# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The names a diagnosis may answer with, and which of them the recordings can judge.

Families are names that recordings often cannot tell apart, with the manoeuvre that separates their members. The effects and
sensor errors of the given robot belong to it like its drags: one that is a little off would be taken for missing physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.next_experiment import (
    CIRCLES,
    COAST,
    RUDDER_STEPS,
    STROKES,
    Plan,
    written,
)
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import (
    SENSOR_FIELDS,
    EffectTable,
    Hypothesis,
    nominal_hypothesis,
)
from fish_sysid.estimation.thresholds import LARGE_EFFECT, STILL, UNIDENTIFIABLE

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
        reasons |= dict.fromkeys(("gyro_scale", "imu_misalignment"), "no IMU sample can be used")
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


FAMILIES: dict[str, tuple[tuple[str, ...], Plan]] = {
    "rudder timing": (
        ("rudder_lag", "rudder_delay", "rudder_backlash", "rudder_saturation", "rudder_gain", "rudder_placement"),
        RUDDER_STEPS,
    ),
    "rudder zero": (("rudder_offset", "camera_heading_offset", "hull_asymmetry"), CIRCLES),
    "heavier head": (("payload", "rotor_imbalance"), STROKES),
    "tail losses": (("tail_joint_damping", "tip_slip", "wake_memory", "tail_hardening"), STROKES),
    "flow": (("current", "nonuniform_current", "tether", "sloshing"), CIRCLES),
    "drags": (("quadratic_drag", "dry_friction", "wave_drag", "wall_effect"), COAST),
    "clocks": (("camera_latency", "imu_latency"), RUDDER_STEPS),
    "motor": (("rotor_lag", "rotor_saturation", "battery_sag"), STROKES),
}  # fmt: skip


def family_of(name: str) -> str:
    """The family of a name; "" for one that stands alone."""
    return next((family for family, (members, _) in FAMILIES.items() if name in members), "")


def separating(families: Sequence[Sequence[str]]) -> dict[str, Any] | None:
    """The manoeuvre that tells the members of the first of these families apart; None where no name has a rival in its family."""
    for members in families:
        family = family_of(members[0]) if members else ""
        kin = [name for name in members if family_of(name) == family]
        if family and len(kin) > 1:
            why, program = FAMILIES[family][1]
            return written(f"tell {', '.join(kin)} apart: {why}", program)
    return None


def known_effects(robot: Robot) -> tuple[str, ...]:
    """Effects of a robot itself and its sensor errors that the filter models, less the filter's latent wrench."""
    effects = (name for name in robot.effects if name != "disturbance")
    return (*effects, *(name for name in robot.sensors if name in SENSOR_FIELDS))


def known_parameters(robot: Robot) -> tuple[str, ...]:
    """Parameters of a robot's own effects, as a hypothesis names them."""
    values = {**robot.effects, **robot.sensors}
    return tuple(f"{name}.{key}" for name in known_effects(robot) for key in values[name])


def start_hypothesis(robot: Robot, experiment: Experiment, noise: Noise) -> Hypothesis:
    """The robot with its nominal parameters free, and of its own effects those that these recordings determine.

    The others stay as given: the prior would draw them to where the effect is none.
    """
    nominal, own = nominal_hypothesis(robot), known_parameters(robot)
    if not own:
        return nominal
    everything = Hypothesis(nominal.robot, nominal.free + own)
    parametrization = everything.parametrization
    information = evaluate(everything, parametrization.origin(), experiment, noise).information
    effects = range(len(nominal.free), len(everything.free))
    kept = identifiable(information, parametrization.prior, effects)
    return Hypothesis(nominal.robot, tuple(everything.free[i] for i in kept))


def identifiable(information: Array, prior: Array, own: range) -> list[int]:
    """Parameters (K,) less those of `own` that the information, which includes the prior, leaves about as unsure as the prior.

    One after the other, the least sure first: recordings may determine a payload's mass times its place alone, and with the
    place fixed they determine the mass.
    """
    kept = list(range(len(prior)))
    while True:
        covariance = np.linalg.inv(information[np.ix_(kept, kept)])
        ratio = dict(
            zip(kept, (np.sqrt(np.diagonal(covariance)) / prior[kept]).tolist(), strict=True)
        )
        unsure = [i for i in kept if i in own and ratio[i] > UNIDENTIFIABLE]
        if not unsure:
            return kept
        kept.remove(max(unsure, key=lambda i: ratio[i]))
