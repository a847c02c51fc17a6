# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known effects put into a recorded trial exactly, as `fish_sysid.dataset.synthetic` does on the grid.

Nothing but the concealed effect is in the result: no noise, no filter, no interpolation, but for the rudder's delay, which
takes commands of the trial itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_bag.trial import Trial

Array = NDArray[np.float64]


class InjectionError(ValueError):
    """An effect that cannot be put into a recording exactly; the message says which."""


def with_effects(trial: Trial, effects: Mapping[str, Mapping[str, float]]) -> Trial:
    """The trial with each of these effects of the vocabulary. Raises InjectionError for one that cannot be put in."""
    for name, values in effects.items():
        if name not in INJECTIONS:
            raise InjectionError(f"injection {name!r}: expected one of {', '.join(INJECTIONS)}")
        trial = INJECTIONS[name](trial, **values)
    return trial


def with_current(trial: Trial, x: float, y: float) -> Trial:
    """The same fish in water that moves with (x, y) [m/s] in the pool frame: positions move by velocity * t."""
    camera = trial.camera
    if camera is None:
        return trial
    t = camera.t - float(camera.t.min(initial=0.0))
    return replace(trial, camera=replace(camera, x=camera.x + x * t, y=camera.y + y * t))


def with_image_age(trial: Trial, delay: float) -> Trial:
    """Every image stamped `delay` [s] later than it was."""
    camera = trial.camera
    if camera is None:
        return trial
    return replace(trial, camera=replace(camera, t=camera.t + delay))


def with_camera_scale(trial: Trial, factor: float) -> Trial:
    """Positions `factor` times as large."""
    camera = trial.camera
    if camera is None:
        return trial
    return replace(trial, camera=replace(camera, x=factor * camera.x, y=factor * camera.y))


def with_heading_offset(trial: Trial, offset: float) -> Trial:
    """The heading marker turned by `offset` [rad]."""
    camera = trial.camera
    if camera is None:
        return trial
    return replace(trial, camera=replace(camera, psi=camera.psi + offset))


def with_gyro_scale(trial: Trial, factor: float) -> Trial:
    """A gyro that reads `factor` times the rate; the IMU's own orientation, which has a filter of its own, stays."""
    imu = trial.imu
    return trial if imu is None else replace(trial, imu=replace(imu, gyro=factor * imu.gyro))


def with_turned_imu(trial: Trial, angle: float) -> Trial:
    """The IMU turned by `angle` [rad] about its own z: rates, forces and orientation are those of the turned axes."""
    imu = trial.imu
    if imu is None:
        return trial
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])  # to the turned axes
    return replace(
        trial, imu=replace(imu, gyro=imu.gyro @ turn.T, accel=imu.accel @ turn.T,
                           orientation=_turned(imu.orientation, angle))
    )  # fmt: skip


def _turned(q: Array, angle: float) -> Array:
    """Quaternions (N, 4) x, y, z, w times a turn about z."""
    x, y, z, w = q.T
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return np.column_stack([x * c + y * s, y * c - x * s, z * c + w * s, w * c - z * s])


def with_rudder_gain(trial: Trial, factor: float) -> Trial:
    """A servo that goes `factor` times as far as commanded: the log holds what it would have had to be commanded."""
    return _with_rudder(trial, lambda rudder, _: rudder / factor)


def with_rudder_offset(trial: Trial, offset: float) -> Trial:
    """A servo whose zero is at `offset` [rad]."""
    return _with_rudder(trial, lambda rudder, _: rudder - offset)


def with_rudder_delay(trial: Trial, delay: float) -> Trial:
    """A servo that gets its commands `delay` [s] late; after the last one it is held."""
    return _with_rudder(trial, lambda rudder, t: np.interp(t + delay, t, rudder))


def _with_rudder(trial: Trial, change: Callable[[Array, Array], Array]) -> Trial:
    commands = trial.commands
    if commands is None:
        return trial
    return replace(trial, commands=replace(commands, rudder=change(commands.rudder, commands.t)))


INJECTIONS: dict[str, Callable[..., Trial]] = {
    "current": with_current,
    "camera_latency": with_image_age,
    "camera_scale": with_camera_scale,
    "camera_heading_offset": with_heading_offset,
    "gyro_scale": with_gyro_scale,
    "imu_misalignment": with_turned_imu,
    "rudder_gain": with_rudder_gain,
    "rudder_offset": with_rudder_offset,
    "rudder_delay": with_rudder_delay,
}
