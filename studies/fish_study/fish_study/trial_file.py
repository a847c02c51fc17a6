# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A trial as it was read, written as a recording: commands, encoder, IMU and camera, with their own stamps.

Samples with a flag are left out, and the rest of a recording too: a diagnosis reads none of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_bag import message_build as build
from fish_bag.trial import Camera, Commands, Encoder, Imu, Stream, Trial
from fish_study.data_set import serialise, write_batches

Array = NDArray[np.float64]
Batch = tuple[str, NDArray[np.int64], list[bytes]]

PLANAR = np.array([0, 1, 5])  # x, y and heading in a covariance of 6 x 6


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
