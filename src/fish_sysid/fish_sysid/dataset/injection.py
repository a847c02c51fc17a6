# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known effects put into recordings exactly, without a model of the fish.

A current is a change of frame: the fish swims in the same water, which now moves. An old image is a stamp that is late. A scale,
a turned sensor or marker changes numbers. A rudder's gain, offset or delay changes the log: what was commanded becomes what a
servo with that effect would have had to be commanded, so that the fish does the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Frames

Array = NDArray[np.float64]


def with_injection(experiment: Experiment, name: str, values: Mapping[str, float]) -> Experiment:
    """The recordings with this effect of the vocabulary. Raises ValueError for one that cannot be put in exactly."""
    if name not in INJECTIONS:
        raise ValueError(f"injection {name!r}: expected one of {', '.join(INJECTIONS)}")
    return INJECTIONS[name](experiment, **values)


def with_current(experiment: Experiment, velocity: tuple[float, float]) -> Experiment:
    """The same fish in water that moves with `velocity` (x, y) [m/s] in the pool frame: poses move by velocity * t."""
    shift = np.array([*velocity, 0.0])
    return _with_poses(experiment, lambda f: f.pose + f.t[:, None] * shift)


def with_image_age(experiment: Experiment, age: float) -> Experiment:
    """The same recordings with every image stamped `age` [s] later than now; those after a trial's end are left out."""
    frames = []
    for f, steps in zip(experiment.frames, experiment.steps, strict=True):
        kept = f.t + age <= DT * (steps - 1)
        frames.append(Frames(f.t[kept] + age, f.pose[kept]))
    return replace(experiment, frames=tuple(frames))


def with_camera_scale(experiment: Experiment, factor: float) -> Experiment:
    """Positions of the camera `factor` times as large."""
    return _with_poses(experiment, lambda f: f.pose * [factor, factor, 1.0])


def with_heading_offset(experiment: Experiment, offset: float) -> Experiment:
    """The heading marker turned by `offset` [rad]."""
    return _with_poses(experiment, lambda f: f.pose + [0.0, 0.0, offset])


def with_gyro_scale(experiment: Experiment, factor: float) -> Experiment:
    """A gyro that reads `factor` times the rate."""
    return replace(experiment, gyro=factor * experiment.gyro)


def with_turned_imu(experiment: Experiment, angle: float) -> Experiment:
    """The IMU turned by `angle` [rad] about z: measured = R(-angle) specific force."""
    cos, sin = np.cos(angle), np.sin(angle)
    ahead, left = np.moveaxis(experiment.accel, -1, 0)
    turned = np.stack([cos * ahead + sin * left, cos * left - sin * ahead], axis=-1)
    return replace(experiment, accel=turned)


def with_rudder_gain(experiment: Experiment, factor: float) -> Experiment:
    """A servo that goes `factor` times as far as commanded."""
    return _with_rudder(experiment, lambda rudder, _: rudder / factor)


def with_rudder_offset(experiment: Experiment, offset: float) -> Experiment:
    """A servo whose zero is at `offset` [rad]."""
    return _with_rudder(experiment, lambda rudder, _: rudder - offset)


def with_rudder_delay(experiment: Experiment, delay: float) -> Experiment:
    """A servo that gets its commands `delay` [s] late; after the last recorded command it is held."""
    return _with_rudder(experiment, lambda rudder, t: np.interp(t + delay, t, rudder))


def _with_poses(experiment: Experiment, change: Callable[[Frames], Array]) -> Experiment:
    frames = tuple(Frames(f.t, change(f)) for f in experiment.frames)
    return replace(experiment, frames=frames)


def _with_rudder(experiment: Experiment, change: Callable[[Array, Array], Array]) -> Experiment:
    commands = experiment.commands.copy()
    for m, steps in enumerate(experiment.steps):
        t = DT * np.arange(steps)
        commands[:steps, m, 1] = change(commands[:steps, m, 1], t)
    return replace(experiment, commands=commands)


INJECTIONS: dict[str, Callable[..., Experiment]] = {
    "current": lambda experiment, x, y: with_current(experiment, (x, y)),
    "camera_latency": lambda experiment, delay: with_image_age(experiment, delay),
    "camera_scale": with_camera_scale,
    "camera_heading_offset": with_heading_offset,
    "gyro_scale": with_gyro_scale,
    "imu_misalignment": with_turned_imu,
    "rudder_gain": with_rudder_gain,
    "rudder_offset": with_rudder_offset,
    "rudder_delay": with_rudder_delay,
}
