# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a servo or linkage that changed makes of a logged rudder command (T,) on the grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Servo:
    """One name of the vocabulary with one parameter, and the values that are tried."""

    parameter: str
    unit: str
    act: Callable[[Array, float], Array]
    neutral: float  # changes nothing
    tried: Array = field(
        default_factory=lambda: np.zeros(0)
    )  # (V,) that the gyro's answer is asked for


def lagged(rudder: Array, time: float) -> Array:
    """A first-order lag of `time` [s]."""
    if time <= 0.0:
        return rudder
    kept = np.exp(-DT / time)
    return np.asarray(lfilter([1.0 - kept], [1.0, -kept], rudder, zi=[kept * rudder[0]])[0])


def delayed(rudder: Array, time: float) -> Array:
    """The command `time` [s] ago."""
    t = DT * np.arange(len(rudder))
    return np.asarray(np.interp(t - time, t, rudder))


def with_play(rudder: Array, play: float) -> Array:
    """A linkage with `play` [rad] to either side."""
    out, at = np.empty_like(rudder), float(rudder[0])
    for k, command in enumerate(rudder.tolist()):
        at = min(max(at, command - play), command + play)
        out[k] = at
    return out


TIMES = np.arange(0.02, 0.29, 0.02)
SERVOS = {
    "rudder_lag": Servo("time_constant", "s", lagged, 0.0, TIMES),
    "rudder_delay": Servo("delay", "s", delayed, 0.0, TIMES),
    "rudder_backlash": Servo("play", "rad", with_play, 0.0, np.arange(0.02, 0.15, 0.02)),
    "rudder_gain": Servo(
        "factor", "1", lambda rudder, factor: factor * rudder, 1.0,
        np.array([0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3, 1.4, 1.5]),
    ),
    # no values: what it adds to the mean yaw rate is also the gyro's bias
    "rudder_offset": Servo("offset", "rad", lambda rudder, offset: rudder + offset, 0.0),
}  # fmt: skip
ANSWERED = {name: servo for name, servo in SERVOS.items() if len(servo.tried)}


def with_servo(experiment: Experiment, name: str, value: float) -> Experiment:
    """The recordings with commands as the servo passed them on."""
    commands = experiment.commands.copy()
    for m, steps in enumerate(experiment.steps):
        commands[:steps, m, 1] = SERVOS[name].act(commands[:steps, m, 1], value)
    return replace(experiment, commands=commands)
