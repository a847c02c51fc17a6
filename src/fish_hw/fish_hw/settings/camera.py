# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the USB camera node."""

from dataclasses import dataclass

from fish_hw.settings.checks import require_range
from fish_node.frames import require_frame, require_frame_prefix


@dataclass(frozen=True)
class CameraSettings:
    """USB camera: device, picture, fixed exposure against glare, calibration."""

    device: str = (
        "/dev/video0"  # V4L2 device, video file (played in a loop), unix:FILE, or "emulator"
    )
    startup_timeout_s: float = (
        0.0  # s to wait for the camera at start, then the node ends with an error; 0: without end
    )
    width: int = 1280  # px
    height: int = 720  # px
    rate_hz: float = 30.0  # Hz
    exposure: int = -1  # V4L2 units of 100 us; -1 automatic
    focus: int = -1  # V4L2 units; -1 automatic
    white_balance_k: int = -1  # K; -1 automatic
    exposure_delay_s: float = 0.0  # s from the middle of the exposure to the driver's time stamp
    reopen_s: float = 1.0  # s without a picture until the camera is opened again
    jpeg_quality: int = 85  # 1 to 100, only where the camera does not send JPEG itself
    publish_raw: bool = False  # also camera/image_raw (2.8 MB a frame)
    calibration_file: str = ""  # YAML of camera_calibration; empty: camera_info without calibration
    frame_id: str = "overhead_optical"  # of pictures and camera_info
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("width", self.width, 16, 8192)
        require_range("height", self.height, 16, 8192)
        require_range("rate_hz", self.rate_hz, 1.0, 240.0)
        require_range("exposure", self.exposure, -1, 100_000)
        require_range("focus", self.focus, -1, 1023)
        require_range("white_balance_k", self.white_balance_k, -1, 10_000)
        require_range("exposure_delay_s", self.exposure_delay_s, 0.0, 0.5)
        require_range("reopen_s", self.reopen_s, 0.1, 60.0)
        require_range("jpeg_quality", self.jpeg_quality, 1, 100)
