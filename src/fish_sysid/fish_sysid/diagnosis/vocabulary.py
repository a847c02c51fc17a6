"""The names a diagnosis may answer with, and which of them the data can speak about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import SENSOR_FIELDS

NOT_A_NAME = ("disturbance",)  # the latent wrench itself
STILL = 1e-3  # rad, rad/s: a command that varies less says nothing
SEEN_STILL = ("rudder_offset",)  # acts on a rudder that is told to stay at zero
SEEN_MOVING = ("rudder_lag", "rudder_delay", "rudder_backlash")  # act when the command changes


class NoCandidateError(ValueError):
    """Nothing that competes can be judged on the recordings; the text says why."""


def candidates() -> tuple[str, ...]:
    """All names: every registered effect, one of a user's own like the others, and the sensor errors that the filter knows."""
    return (*(name for name in EFFECTS if name not in NOT_A_NAME), *SENSOR_FIELDS)


def known(names: Sequence[str]) -> tuple[str, ...]:
    """The names, each once. Raises ValueError for one that is no candidate."""
    for name in names:
        if name not in candidates():
            raise ValueError(f"unknown candidate {name!r}; known: {', '.join(candidates())}")
    return tuple(dict.fromkeys(names))


def kind_of(name: str) -> str:
    """physics, actuator or sensor."""
    return "sensor" if name in SENSOR_EFFECTS else EFFECTS[name].kind


def unjudged(experiment: Experiment, robot: Robot) -> dict[str, str]:
    """Candidates about which nothing can be said beside this robot and these recordings, with the reason."""
    given = dict.fromkeys(
        (*robot.effects, *robot.sensors), "the given robot has it, and its values are refitted"
    )
    return out_of_reach(experiment) | given


def out_of_reach(experiment: Experiment) -> dict[str, str]:
    """Candidates on which these recordings say nothing, with the reason."""
    reasons: dict[str, str] = {}
    if not np.isfinite(experiment.gyro).any():
        reasons |= dict.fromkeys(("gyro_scale", "imu_misalignment"), "no IMU was recorded")
    rotor, rudder = experiment.given_commands.T
    if np.abs(rudder).max() < STILL:
        unseen = [name for name in EFFECTS if name.startswith("rudder_") and name not in SEEN_STILL]
        reasons |= dict.fromkeys(unseen, "the rudder never moved")
    elif np.ptp(rudder) < STILL:
        reasons |= dict.fromkeys(SEEN_MOVING, "the rudder's command never changed")
    if np.ptp(rotor) < STILL:
        unseen = ["rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"]
        reasons |= dict.fromkeys(unseen, "the rotor never moved")
    return reasons
