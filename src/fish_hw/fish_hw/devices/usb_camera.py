# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overhead camera as a whole: frames as JPEG with the middle of their exposure, found again after it was
lost.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np

from fish_hw.devices.reconnect import ERROR, OK, WARN, DeviceError, Link, Status
from fish_hw.settings import CameraSettings
from fish_hw.transport.interfaces import PortUnavailable
from fish_hw.transport.video_capture import Frame
from fish_node.file_head import LARGEST_SIDE, jpeg_size

LIVE = ("/dev/", "unix:")  # devices with noise of their own; a file may hold equal pictures
CLOSE_WAIT_S = 1.5  # longer than a camera keeps OpenCV waiting
SLOW = 0.8  # share of the asked rate below which the operator should know (dark picture, USB bandwidth)


class FrameSource(Protocol):
    """A camera, a file or a test picture."""

    def read(self) -> Frame | None:
        """The next frame, waiting for it; None if there was none."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...


@dataclass(frozen=True)
class Picture:
    """JPEG bytes of one frame with the time [s, monotonic clock] of its exposure; size in px."""

    time_s: float
    jpeg: bytes
    width: int
    height: int


@dataclass
class CameraCycle:
    """What one step brought."""

    picture: Picture | None = None
    events: list[str] = field(default_factory=list)


class UsbCamera:
    """Reads one frame per step."""

    def __init__(
        self,
        settings: CameraSettings,
        open_source: Callable[[], FrameSource],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.frames = 0
        self.missed = 0
        self.repeated = 0
        self._settings = settings
        self._open_source = open_source
        self._clock = clock
        self._source: FrameSource | None = None
        self._reading = threading.Lock()
        self._link = Link("camera")
        self._last_frame = clock()
        self._rated = (0, clock())
        self._size = (settings.width, settings.height)
        self._newest, self._still = b"", False

    @property
    def connected(self) -> bool:
        """Whether the device is open."""
        return self._source is not None

    def connect(self) -> None:
        """Open the camera; PortUnavailable if it cannot."""
        self._source = self._open_source()
        self._last_frame = self._clock()

    def step(self) -> CameraCycle:
        """Wait for a frame; the camera is opened again when none came for reopen_s."""
        now = self._clock()
        try:
            if self._source is None:
                return self._reconnect(now)
            with self._reading:
                frame = self._source.read()
            if frame is None:
                self._miss()
                return CameraCycle()
            picture = self._picture(frame)
            if picture is not None and self._stands_still(picture):
                return CameraCycle()
            self._last_frame = self._clock()
            return CameraCycle(picture, self._link.works())
        except (PortUnavailable, DeviceError) as error:
            self.close()
            return CameraCycle(events=self._link.lose(str(error), now))

    def close(self) -> None:
        """Give the camera back; a picture that another thread is reading is waited for."""
        if self._source is None or not self._reading.acquire(timeout=CLOSE_WAIT_S):
            return  # to release it in the middle of a read ends the process the hard way
        self._source.close()
        self._source = None
        self._reading.release()

    def status(self) -> Status:
        """State in one line with counters and the rate since the last call."""
        rate = self._rate()
        values: dict[str, object] = {
            "frames": self.frames,
            "missed frames": self.missed,
            "repeated frames": self.repeated,
            "rate [Hz]": round(rate, 1),
            "size [px]": f"{self._size[0]}x{self._size[1]}",
            "reconnect attempts": self._link.attempts,
        }
        if self._source is None:
            return Status(ERROR, self._link.trouble, values)
        if rate == 0.0:
            return Status(ERROR, "no frames", values)
        if self._still:
            return Status(ERROR, "the picture stands still: not sent on", values)
        if self._size != (self._settings.width, self._settings.height):
            wanted = f"{self._settings.width}x{self._settings.height}"
            return Status(
                WARN, f"frames are {self._size[0]}x{self._size[1]} px instead of {wanted}", values
            )
        if rate < SLOW * self._settings.rate_hz:
            return Status(
                WARN, f"{rate:.0f} frames/s instead of {self._settings.rate_hz:.0f}", values
            )
        return Status(OK, f"{rate:.0f} frames/s", values)

    def _picture(self, frame: Frame) -> Picture | None:
        time_s = frame.time_s - self._settings.exposure_delay_s
        if frame.image is not None:
            jpeg = encode_jpeg(frame.image, self._settings.jpeg_quality)
            height, width = frame.image.shape[:2]
        elif frame.jpeg is not None and (size := jpeg_size(frame.jpeg)) is not None:
            jpeg, (width, height) = frame.jpeg, size
        else:
            self.missed += 1
            return None
        self.frames += 1
        self._size = (width, height)
        return Picture(time_s, jpeg, width, height)

    def _stands_still(self, picture: Picture) -> bool:
        """Whether a camera's picture is the one before to the last bit, which its noise forbids: it is not sent on."""
        before, self._newest = self._newest, picture.jpeg
        self._still = before == picture.jpeg and self._settings.device.startswith(LIVE)
        if not self._still:
            return False
        self.repeated += 1
        self._give_up("the picture stands still")
        return True

    def _miss(self) -> None:
        self.missed += 1
        self._give_up("no frames")

    def _give_up(self, what: str) -> None:
        """Open the camera again when nothing new came for reopen_s."""
        if self._clock() - self._last_frame > self._settings.reopen_s:
            raise DeviceError(
                f"camera {self._settings.device}: {what} for {self._settings.reopen_s} s"
            )

    def _rate(self) -> float:
        now, (frames, since) = self._clock(), self._rated
        self._rated = (self.frames, now)
        return (self.frames - frames) / max(now - since, 1e-3)

    def _reconnect(self, now: float) -> CameraCycle:
        if self._link.due(now):
            self.connect()
        return CameraCycle()


def encode_jpeg(image: np.ndarray, quality: int) -> bytes:
    """JPEG of a BGR image (height, width, 3)."""
    ok, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not ok:
        raise ValueError(
            f"an image of shape {image.shape} and type {image.dtype} cannot be encoded as JPEG"
        )
    return bytes(data)


def decode_jpeg(jpeg: bytes) -> np.ndarray | None:
    """BGR image (height, width, 3) of a JPEG, None if it is damaged beyond reading or larger than LARGEST_SIDE."""
    size = jpeg_size(jpeg)
    if size is None or max(size) > LARGEST_SIDE:  # a bit error in the head asks for gigabytes
        return None
    try:
        return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
