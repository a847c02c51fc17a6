# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a pair: OLD without and NEW with what is concealed, of the second plant or of recordings that a user has.

Into a user's trials known effects are put exactly, as `fish_sysid.dataset.injection` does on the grid: nothing but the concealed
effect is in the result, no noise, no filter, no interpolation, but for the rudder's delay, which takes commands of the trial
itself. A trial is written as it was read: commands, encoder, IMU and camera, with their own stamps. Samples with a flag are left
out, and the rest of a recording too: a diagnosis reads none of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_bag import message_build as build
from fish_bag.dataset import read_dataset
from fish_bag.trial import Camera, Commands, Encoder, Imu, Stream, Trial
from fish_study.build import make_recordings
from fish_study.data_set import serialise, write_batches
from fish_study.scenario import Scenario, ScenarioError

OLD, NEW = "old", "new"  # folders of a pair
NEW_SHARE = 1 / 3  # of a user's recordings
FEWEST = 10  # recordings of a user: seven of OLD and three of NEW are the least that are compared
Array = NDArray[np.float64]
Batch = tuple[str, NDArray[np.int64], list[bytes]]

PLANAR = np.array([0, 1, 5])  # x, y and heading in a covariance of 6 x 6


def make_pair(scenario: Scenario, folder: Path) -> dict[str, float]:
    """Write the folders `old` and `new`; the trials that ended at a wall as `make_recordings` says.

    Raises ScenarioError where a pair cannot be made.
    """
    folder.mkdir(parents=True)
    if scenario.recordings:
        _injected(scenario, folder)
        return {}
    ended: dict[str, float] = {}
    still = replace(scenario, effects={}, count=scenario.old, seed=scenario.seed + 1)
    for name, one in ((OLD, still), (NEW, scenario)):
        at_wall = make_recordings(one, folder / name)
        ended |= {f"{name}/{trial}": seconds for trial, seconds in at_wall.items()}
    return ended


def _injected(scenario: Scenario, folder: Path) -> None:
    """Some of the user's recordings as they are, others with the concealed effects."""
    old, new = split(list(read_dataset(Path(scenario.recordings))), scenario.seed)
    for name, trials, effects in ((OLD, old, {}), (NEW, new, scenario.effects)):
        for trial in trials:
            try:
                write_trial_file(
                    folder / name / folder_name(trial.name), with_effects(trial, effects)
                )
            except (InjectionError, ValueError) as error:
                raise ScenarioError(str(error)) from error


def folder_name(trial: str) -> str:
    """Name of a trial's folder; no two trials share it, though their names have dots or lie in folders."""
    return trial.replace("/", "_").removesuffix(".mcap")


def enough(trials: Sequence[Trial]) -> list[Trial]:
    """Those with commands and camera. Raises ScenarioError for too few."""
    usable = [trial for trial in trials if trial.commands is not None and trial.camera is not None]
    if len(usable) < FEWEST:
        raise ScenarioError(
            f"got {len(usable)} recordings with commands and camera; expected at least {FEWEST}, which are split into OLD and NEW"
        )
    return usable


def split(trials: Sequence[Trial], seed: int) -> tuple[list[Trial], list[Trial]]:
    """(OLD, NEW): runs chosen at random, NEW_SHARE of them NEW. Raises ScenarioError for too few."""
    usable = enough(trials)
    order = np.random.default_rng(seed).permutation(len(usable))
    count = max(3, round(NEW_SHARE * len(usable)))
    new, old = sorted(order[:count].tolist()), sorted(order[count:].tolist())
    return [usable[i] for i in old], [usable[i] for i in new]


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


def write_trial_file(directory: Path, trial: Trial) -> None:
    """Write the trial into a new directory. Raises ValueError without commands and camera."""
    clean = trial.clean()
    if clean.commands is None or clean.camera is None:
        raise ValueError(f"{trial.name}: got no commands or no camera; expected both")
    batches = [_commands(clean, clean.commands), _camera(clean, clean.camera)]
    if clean.imu is not None:
        batches.append(_imu(clean, clean.imu))
    if clean.encoder is not None:
        batches.append(_encoder(clean, clean.encoder))
    write_batches(directory, batches)


def _times(trial: Trial, stream: Stream) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Stamps and arrivals [ns since epoch]; nothing arrives before it was measured."""
    stamps, arrivals = (
        trial.origin_ns + np.round(1e9 * t).astype(np.int64)
        for t in (stream.t, np.maximum(stream.t, stream.t_arrival))
    )
    return stamps, arrivals


def _commands(trial: Trial, c: Commands) -> Batch:
    stamps, arrivals = _times(trial, c)
    template = build.joints(0, ["rotor", "rudder"], [0.0, 0.0], [0.0, np.nan])
    columns = {
        "position": np.column_stack([c.rotor_phase, c.rudder]),
        "velocity": np.column_stack([c.rotor_speed, np.full(len(c), np.nan)]),
    }
    return "joint_command", arrivals, serialise(template, stamps, columns)


def _encoder(trial: Trial, e: Encoder) -> Batch:
    stamps, arrivals = _times(trial, e)
    columns = {"position": e.angle[:, None], "velocity": e.speed[:, None]}
    template = build.joints(0, ["rotor"], [0.0], [0.0])
    return "joint_states", arrivals, serialise(template, stamps, columns)


def _imu(trial: Trial, imu: Imu) -> Batch:
    stamps, arrivals = _times(trial, imu)
    columns: dict[str, Array] = {}
    for name, values in (("angular_velocity", imu.gyro), ("linear_acceleration", imu.accel)):
        columns |= {f"{name}.{k}": v for k, v in zip("xyz", values.T, strict=True)}
    # a quaternion of zeros is read as none
    turned = np.nan_to_num(imu.orientation)
    columns |= {f"orientation.{k}": v for k, v in zip("xyzw", turned.T, strict=True)}
    template = build.imu(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    return "imu/data", arrivals, serialise(template, stamps, columns)


def _camera(trial: Trial, camera: Camera) -> Batch:
    stamps, arrivals = _times(trial, camera)
    covariance = np.zeros((len(camera), 6, 6))
    covariance[:, PLANAR[:, None], PLANAR] = camera.covariance
    columns = {
        "pose.pose.position.x": camera.x,
        "pose.pose.position.y": camera.y,
        "pose.pose.orientation.z": np.sin(0.5 * camera.psi),
        "pose.pose.orientation.w": np.cos(0.5 * camera.psi),
        "pose.covariance": covariance.reshape(-1, 36),
    }
    template = build.camera_pose(0, "pool", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return "camera/pose", arrivals, serialise(template, stamps, columns)
