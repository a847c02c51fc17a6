# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a recorded trial: overhead camera, IMU, encoder, with their noise and their errors.

Noise as in `fish_sim.sensors.noise_levels`, times a factor. Knows nothing of the fish, so that the second plant can use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.sensors.noise_levels import (
    ACCELEROMETER,
    BIAS,
    CAMERA_HEADING,
    CAMERA_POSITION,
    ENCODER_SPEED,
    GYRO,
    exposure_times,
)
from fish_study.trials import PERIOD

Array = NDArray[np.float64]


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
