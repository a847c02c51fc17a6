# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Let a plant swim under a driver and write down what its sensors say: overhead camera, IMU, encoder, noise and errors.

Noise as in `fish_sim.sensors.noise_levels`, times a factor. The sensors know nothing of the fish: the second plant uses them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.pool import HALF_LENGTH, HALF_WIDTH
from fish_sim.sensors.noise_levels import (
    ACCELEROMETER,
    BIAS,
    CAMERA_HEADING,
    CAMERA_LATENCY,
    CAMERA_POSITION,
    ENCODER_SPEED,
    GYRO,
    exposure_times,
)
from fish_study.trials import PERIOD, Pose

Array = NDArray[np.float64]
SHORTEST = 3.0  # s, a trial that ends earlier at a wall tells nothing


@dataclass(frozen=True)
class SensorErrors:
    """What the sensors do to the truth."""

    latency: float = 0.0  # s, the image is older than its stamp
    scale: float = 1.0  # of the camera's metres
    heading_offset: float = 0.0  # rad
    gyro_scale: float = 1.0
    misalignment: float = 0.0  # rad, of the IMU's axes

    @classmethod
    def of(cls, sensors: Mapping[str, Mapping[str, float]]) -> SensorErrors:
        """From the vocabulary's names."""
        fields = {
            "camera_latency": "latency",
            "camera_scale": "scale",
            "camera_heading_offset": "heading_offset",
            "gyro_scale": "gyro_scale",
            "imu_misalignment": "misalignment",
        }
        return cls(
            **{fields[name]: next(iter(values.values())) for name, values in sensors.items()}
        )


class SensorModels:
    """Of M fish over T grid points; all noise is drawn at once, so that a sample is the same whenever it is asked for."""

    def __init__(
        self,
        steps: int,
        count: int,
        noise: float,
        errors: SensorErrors,
        random: np.random.Generator,
    ) -> None:
        self.errors = errors
        self._bias = random.standard_normal((count, 3)) * BIAS
        self._gyro = noise * GYRO * random.standard_normal((steps, count))
        self._accel = noise * ACCELEROMETER * random.standard_normal((steps, count, 2))
        self._encoder = noise * ENCODER_SPEED * random.standard_normal((steps, count))
        self.stamps = [exposure_times(PERIOD * (steps - 1), random) for _ in range(count)]
        sd = noise * np.array([CAMERA_POSITION, CAMERA_POSITION, CAMERA_HEADING])
        self._camera = [sd * random.standard_normal((len(t), 3)) for t in self.stamps]

    def imu(self, k: int, rate: Array, forward: Array, left: Array) -> tuple[Array, Array]:
        """Gyro (M,) and accelerometer (M, 2) at grid point k from the true rates and accelerations (M,)."""
        cos, sin = np.cos(self.errors.misalignment), np.sin(self.errors.misalignment)
        force = np.stack([cos * forward + sin * left, cos * left - sin * forward], axis=-1)
        gyro = self.errors.gyro_scale * rate + self._bias[:, 0] + self._gyro[k]
        return gyro, force + self._bias[:, 1:] + self._accel[k]

    def encoder(self, speed: Array) -> Array:
        """Rotor speeds (T, M) as measured."""
        return speed + self._encoder[: len(speed)]

    def poses(self, m: int, frames: slice, truth: Array) -> Array:
        """(F, 3) poses of some frames of fish m; truth (K, 3) its poses at grid points until now."""
        seen = np.clip(self.stamps[m][frames] - self.errors.latency, 0.0, PERIOD * (len(truth) - 1))
        grid = PERIOD * np.arange(len(truth))
        pose = np.column_stack([np.interp(seen, grid, truth[:, i]) for i in range(3)])
        pose[:, :2] *= self.errors.scale
        pose[:, 2] += self.errors.heading_offset
        return pose + self._camera[m][frames]


class Inertial(NamedTuple):
    """True motion of the head at the start of a period, with the drive of that period: (M,) each."""

    rate: Array  # rad/s
    forward: Array  # m/s^2, acceleration along x of base_link
    left: Array  # m/s^2


class PlantWithImu(Protocol):
    """M fish in the water."""

    def reset(self, poses: Array) -> None:
        """At rest at (M, 3) poses."""

    def step(self, commands: Array) -> Inertial:
        """Follow commands (M, 2) for one period; what an IMU feels at its start."""

    @property
    def pose(self) -> Array:
        """(M, 3) x, y [m], heading [rad, not wrapped] of the head."""

    @property
    def rotor_speed(self) -> Array:
        """(M,) rad/s."""


class CommandSource(Protocol):
    """Who commands."""

    def command(self, k: int) -> tuple[Array, Array]:
        """Commands (M, 2) and rotor phases (M,) at grid point k."""

    def observe(self, k: int, gyro: Array, accel: Array, poses: Sequence[Sequence[Pose]]) -> None:
        """IMU samples of grid point k and camera poses (stamp, x, y, heading) that arrived in the period after it."""


@dataclass(frozen=True)
class Readings:
    """M trials on T grid points of 10 ms.

    The plants' water has no end: a trial is a swim in the pool until the head comes to a wall. `ends` says how many grid
    points that are.
    """

    commands: Array  # (T, M, 2) rad/s, rad
    phase: Array  # (T, M) rad
    gyro: Array  # (T, M)
    accel: Array  # (T, M, 2)
    encoder: Array  # (T, M)
    stamps: tuple[Array, ...]  # (F,) s, of the camera's frames
    poses: tuple[Array, ...]  # (F, 3)
    truth: Array  # (T, M, 3) poses
    ends: NDArray[
        np.int64
    ]  # (M,) grid points before the head comes to a wall; T where it never does

    def trial(self, m: int) -> Readings:
        """Trial m alone, up to its end."""
        n = int(self.ends[m])
        seen = self.stamps[m] <= PERIOD * (n - 1)
        arrays = {
            k: getattr(self, k)[:n, m : m + 1]
            for k in ("commands", "phase", "gyro", "accel", "encoder", "truth")
        }
        stamps, poses = (self.stamps[m][seen],), (self.poses[m][seen],)
        return replace(self, stamps=stamps, poses=poses, ends=self.ends[m : m + 1], **arrays)


def until_a_wall(truth: Array) -> NDArray[np.int64]:
    """(M,) grid points of poses (T, M, 3) before the first at a wall of the pool or beyond; T where there is none."""
    outside = np.any(np.abs(truth[..., :2]) >= [HALF_LENGTH, HALF_WIDTH], axis=-1)
    return np.where(outside.any(axis=0), np.argmax(outside, axis=0), len(truth))


def kept_trials(readings: Sequence[Readings]) -> dict[str, Readings]:
    """Every trial up to its end, by the name of its recording, numbered over all.

    Those that end at a wall before SHORTEST are left out.
    """
    numbered = enumerate((part, m) for part in readings for m in range(len(part.ends)))
    return {
        f"trial_{k:02d}": part.trial(m)
        for k, (part, m) in numbered
        if part.ends[m] == len(part.commands) or PERIOD * part.ends[m] >= SHORTEST
    }


def ended_at_a_wall(readings: Sequence[Readings]) -> dict[str, float]:
    """Names of the trials that came to a wall, and how long each lasted until then [s]."""
    ends = [(int(end), len(part.commands)) for part in readings for end in part.ends]
    return {f"trial_{k:02d}": PERIOD * end for k, (end, steps) in enumerate(ends) if end < steps}


def swim(
    plant: PlantWithImu, starts: Array, driver: CommandSource, sensors: SensorModels, steps: int
) -> Readings:
    """`steps` grid points from rest at `starts` (M, 3)."""
    plant.reset(starts)
    count = len(starts)
    commands, phase = np.empty((steps, count, 2)), np.empty((steps, count))
    gyro, accel = np.empty((steps, count)), np.empty((steps, count, 2))
    truth, speed, shown = np.empty((steps + 1, count, 3)), np.empty((steps, count)), [0] * count
    truth[0] = plant.pose
    for k in range(steps):
        commands[k], phase[k] = driver.command(k)
        speed[k] = plant.rotor_speed
        gyro[k], accel[k] = sensors.imu(k, *plant.step(commands[k]))
        truth[k + 1] = plant.pose
        arrived = []
        for m in range(count):
            new = int(
                np.searchsorted(sensors.stamps[m], PERIOD * (k + 1) - CAMERA_LATENCY, side="right")
            )
            frames = slice(shown[m], new)
            poses = sensors.poses(m, frames, truth[: k + 2, m]) if new > shown[m] else ()
            stamps = sensors.stamps[m][frames]
            arrived.append(
                [(float(t), x, y, psi) for t, (x, y, psi) in zip(stamps, poses, strict=True)]
            )
            shown[m] = new
        driver.observe(k, gyro[k], accel[k], arrived)
    everything = tuple(sensors.poses(m, slice(None), truth[:steps, m]) for m in range(count))
    return Readings(
        commands,
        phase,
        gyro,
        accel,
        sensors.encoder(speed),
        tuple(sensors.stamps),
        everything,
        truth[:steps],
        until_a_wall(truth[:steps]),
    )
