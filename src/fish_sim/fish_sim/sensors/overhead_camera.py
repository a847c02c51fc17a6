# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overhead camera as a sensor of poses: noise, jitter, lost frames and latency, without a picture."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.sensors.settings import SensorSettings

HISTORY = 2.0  # s of true poses kept; longer than any camera_latency effect


@dataclass(frozen=True)
class CameraPose:
    """A measured pose of the head in the pool frame."""

    stamp: float  # s, moment of the exposure as the camera tells it
    arrival: float  # s, when the pose is there
    x: float  # m
    y: float  # m
    heading: float  # rad


class OverheadCamera:
    """Exposes at camera_rate with jitter; a sample arrives camera_latency after its stamp or is lost."""

    def __init__(
        self, settings: SensorSettings, distortion: SensorDistortion, random: Generator
    ) -> None:
        self._settings, self._distortion, self._random = settings, distortion, random
        self._truth: deque[tuple[float, float, float, float]] = deque()
        self._waiting: deque[CameraPose] = deque()
        self._next: float | None = None

    def update(self, time: float, x: float, y: float, heading: float) -> list[CameraPose]:
        """Take the true pose at a time [s]; return the samples that have arrived by then, in order.

        heading must be continuous (not wrapped); times must increase.
        """
        self._truth.append((time, x, y, heading))
        while self._truth[0][0] < time - HISTORY:
            self._truth.popleft()
        if self._next is None:
            self._next = time
        while self._next <= time:
            self._expose(self._next)
            period = 1.0 / self._settings.camera_rate
            self._next += max(
                0.1 * period, period + self._random.normal(0.0, self._settings.camera_jitter)
            )
        arrived = []
        while self._waiting and self._waiting[0].arrival <= time + 1e-9:
            arrived.append(self._waiting.popleft())
        return arrived

    def _expose(self, stamp: float) -> None:
        s, random = self._settings, self._random
        if random.random() < s.camera_loss:
            return
        seen = stamp - self._distortion.pose_delay()
        times, *columns = np.array(self._truth).T
        x, y, heading = (float(np.interp(seen, times, column)) for column in columns)
        x, y, heading = self._distortion.pose(x, y, heading)
        noise = random.normal(
            0.0, (s.camera_position_noise, s.camera_position_noise, s.camera_heading_noise)
        )
        arrival = stamp + s.camera_latency
        self._waiting.append(
            CameraPose(stamp, arrival, x + noise[0], y + noise[1], heading + noise[2])
        )
