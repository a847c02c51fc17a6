"""The names a diagnosis may answer with, and which of them the data can speak about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.sensors import SENSOR_EFFECTS
from fish_train.identify.experiment import Experiment

NOT_A_NAME = ("disturbance",)  # the latent wrench itself


def candidates() -> tuple[str, ...]:
    """All names: every registered effect and sensor error. An effect a user registers competes like the others."""
    return (*(name for name in EFFECTS if name not in NOT_A_NAME), *SENSOR_EFFECTS)


def known(names: Sequence[str]) -> tuple[str, ...]:
    """The names, checked. Raises ValueError for one that is no candidate."""
    for name in names:
        if name not in candidates():
            raise ValueError(f"unknown candidate {name!r}; known: {', '.join(candidates())}")
    return tuple(names)


def kind_of(name: str) -> str:
    """physics, actuator or sensor."""
    return "sensor" if name in SENSOR_EFFECTS else EFFECTS[name].kind


def out_of_reach(experiment: Experiment) -> dict[str, str]:
    """Candidates on which these recordings say nothing, with the reason."""
    reasons: dict[str, str] = {}
    if not np.isfinite(experiment.gyro).any():
        reasons |= dict.fromkeys(("gyro_scale", "imu_misalignment"), "no IMU was recorded")
    rotor, rudder = experiment.given_commands.T
    if np.ptp(rudder) < 1e-3:
        still = [name for name in EFFECTS if name.startswith("rudder_")]
        reasons |= dict.fromkeys(still, "the rudder never moved")
    if np.ptp(rotor) < 1e-3:
        still = ["rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"]
        reasons |= dict.fromkeys(still, "the rotor never moved")
    return reasons
