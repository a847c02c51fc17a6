# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A V4L2 camera or a video file by OpenCV: the newest frame with its time, JPEG as the camera sent it if it
can.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from fish_hw.settings import CameraSettings
from fish_hw.transport.interfaces import unavailable

AUTO_EXPOSURE, MANUAL_EXPOSURE = 3, 1  # V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_EXPOSURE_MANUAL
MJPG = cv2.VideoWriter.fourcc(*"MJPG")
GRAB_TIMEOUT_S = 1  # whole seconds that a camera may keep OpenCV waiting, instead of 10
OLDEST_STAMP_S = 0.5  # a driver's time stamp older than this is on another clock
JPEG_START, JPEG_END = b"\xff\xd8", b"\xff\xd9"


@dataclass(frozen=True)
class Frame:
    """One picture: JPEG bytes if the camera sent such, else a BGR image (height, width, 3); monotonic time
    [s].
    """

    time_s: float
    jpeg: bytes | None = None
    image: np.ndarray | None = None


class VideoCapture:
    """An open camera; file names that are no device are played in a loop at the set rate."""

    def __init__(
        self,
        settings: CameraSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        silence_opencv()  # the reason is said once, here
        self._settings = settings
        self._clock, self._sleep = clock, sleep
        self._live = settings.device.startswith("/dev/")
        self._next_s = clock()
        self._capture: Any = self._open()
        if not self._capture.isOpened():
            self._capture.release()
            raise unavailable(f"camera {settings.device}", self._reason(), self._others())
        if self._live:
            self._configure()

    def read(self) -> Frame | None:
        """The next frame, waiting for it; None if the camera gave none."""
        if not self._capture.grab():
            self._rewind()
            return None
        time_s = self._frame_time(self._clock())
        try:
            ok, image = self._capture.retrieve()
        except cv2.error:  # a damaged frame
            return None
        if not ok or image is None:
            return None
        if image.ndim == 3:
            self._keep_pace()
            return Frame(time_s, image=image)
        return compressed_frame(time_s, image.tobytes())

    def close(self) -> None:
        """Give the camera back."""
        self._capture.release()

    def _open(self) -> Any:
        if self._live:
            # OpenCV looks for it at its first wait for a frame, not when it is imported (cap_v4l.cpp, tryIoctl)
            os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", str(GRAB_TIMEOUT_S))
            return cv2.VideoCapture(self._settings.device, cv2.CAP_V4L2)
        return cv2.VideoCapture(self._settings.device)

    def _configure(self) -> None:
        """Format before size, one buffer, fixed exposure if asked; what a camera does not have it ignores."""
        settings, capture = self._settings, self._capture
        capture.set(cv2.CAP_PROP_FOURCC, MJPG)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        capture.set(cv2.CAP_PROP_FPS, settings.rate_hz)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if capture.get(cv2.CAP_PROP_FOURCC) == MJPG:
            capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # pass the camera's JPEG through
        capture.set(
            cv2.CAP_PROP_AUTO_EXPOSURE, AUTO_EXPOSURE if settings.exposure < 0 else MANUAL_EXPOSURE
        )
        if settings.exposure >= 0:
            capture.set(cv2.CAP_PROP_EXPOSURE, settings.exposure)
        capture.set(cv2.CAP_PROP_AUTOFOCUS, float(settings.focus < 0))  # OpenCV 5 takes no bool
        if settings.focus >= 0:
            capture.set(cv2.CAP_PROP_FOCUS, settings.focus)
        capture.set(cv2.CAP_PROP_AUTO_WB, float(settings.white_balance_k < 0))
        if settings.white_balance_k >= 0:
            capture.set(cv2.CAP_PROP_WB_TEMPERATURE, settings.white_balance_k)

    def _frame_time(self, now: float) -> float:
        """The kernel's stamp of the frame (monotonic clock) where there is a believable one, else now."""
        stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000 if self._live else 0.0
        return float(stamp) if 0.0 <= now - stamp < OLDEST_STAMP_S else now

    def _keep_pace(self) -> None:
        """A file is read faster than it was filmed."""
        if self._live:
            return
        self._next_s = max(
            self._next_s + 1 / self._settings.rate_hz, self._clock() - 1 / self._settings.rate_hz
        )
        self._sleep(max(self._next_s - self._clock(), 0.0))

    def _rewind(self) -> None:
        if not self._live:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)

    def _reason(self) -> str:
        device = self._settings.device
        if not Path(device).exists():
            return "there is no such device or file"
        if not os.access(device, os.R_OK):
            return "no permission (add the user to group video)"
        return "another program holds it, or it is no video"

    def _others(self) -> list[str]:
        return sorted(path for path in glob("/dev/video*") if path != self._settings.device)


def silence_opencv() -> None:
    """No messages of OpenCV's own on the console; the setting has another name before OpenCV 4.7."""
    if hasattr(cv2, "utils") and hasattr(cv2.utils, "logging"):
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    else:
        cv2.setLogLevel(0)  # type: ignore[attr-defined]


def compressed_frame(time_s: float, data: bytes) -> Frame | None:
    """A frame of the camera's own JPEG, without the padding behind its end; None if it is no whole JPEG."""
    end = data.rfind(JPEG_END)
    if not data.startswith(JPEG_START) or end < 0:
        return None
    return Frame(time_s, jpeg=data[: end + len(JPEG_END)])
