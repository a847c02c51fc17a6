# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A camera made of software: a grey picture with a bright square that walks to the right."""

import time
from collections.abc import Callable

import numpy as np

from fish_hw.settings import CameraSettings
from fish_hw.transport.video_capture import Frame

GREY, BRIGHT = 90, 230
STEP_PX = 4
SQUARE_PX = 40


class WalkingSquare:
    """Frame source with the pace and size of the settings."""

    def __init__(
        self,
        settings: CameraSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._settings = settings
        self._clock, self._sleep = clock, sleep
        self._next_s = clock()
        self._count = 0

    def read(self) -> Frame:
        """The next picture, when it is due."""
        self._sleep(max(self._next_s - self._clock(), 0.0))
        time_s = self._clock()
        self._next_s = max(self._next_s, time_s - 1.0) + 1 / self._settings.rate_hz
        height, width = self._settings.height, self._settings.width
        image = np.full((height, width, 3), GREY, np.uint8)
        left = STEP_PX * self._count % max(width - SQUARE_PX, 1)
        image[height // 2 : height // 2 + SQUARE_PX, left : left + SQUARE_PX] = BRIGHT
        self._count += 1
        return Frame(time_s, image=image)

    def close(self) -> None:
        """Nothing to give back."""
