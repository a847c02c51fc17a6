# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `camera`: the overhead USB camera.

Out: camera/image_raw/compressed (JPEG), camera/camera_info (same stamp and frame), camera/image_raw on
     request,
     /diagnostics
Service: camera/set_camera_info (sensor_msgs/SetCameraInfo), see calibration.py
"""

from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from fish_hw.devices.usb_camera import FrameSource, Picture, UsbCamera, decode_jpeg
from fish_hw.emulators.walking_square import WalkingSquare
from fish_hw.nodes.calibration import Calibration
from fish_hw.nodes.device_node import DeviceNode, run
from fish_hw.settings.camera import CameraSettings
from fish_hw.transport.unix_socket import PREFIX, SocketCamera
from fish_hw.transport.video_capture import VideoCapture


class CameraNode(DeviceNode):
    """Pictures out; the camera is handled in UsbCamera."""

    def __init__(self) -> None:
        super().__init__("camera", CameraSettings)
        settings = self.settings
        self._calibration = Calibration(self, settings)
        self._compressed = self.create_publisher(
            CompressedImage, "camera/image_raw/compressed", QoSProfile(depth=2)
        )
        self._camera_info_publisher = self.create_publisher(
            CameraInfo, "camera/camera_info", QoSProfile(depth=2)
        )
        self._raw = (
            self.create_publisher(Image, "camera/image_raw", QoSProfile(depth=2))
            if settings.publish_raw
            else None
        )
        self._camera = UsbCamera(settings, self._open_source, self.clock.now)
        self.use(self._camera, self._cycle, 0.5 / settings.rate_hz, settings.device == "emulator")

    def _open_source(self) -> FrameSource:
        if self.settings.device == "emulator":
            return WalkingSquare(self.settings, self.clock.now)
        if self.settings.device.startswith(PREFIX):
            return SocketCamera(self.settings.device)
        return VideoCapture(self.settings)

    def _cycle(self) -> None:
        cycle = self._camera.step()
        self.log_events(cycle.events)
        if cycle.picture is not None:
            self._publish_picture(cycle.picture)

    def _publish_picture(self, picture: Picture) -> None:
        header = Header(
            stamp=self.stamp(picture.time_s),
            frame_id=self.settings.frame_prefix + self.settings.frame_id,
        )
        info = self._calibration.info
        info.header = header
        self.publish(
            self._compressed,
            CompressedImage(header=header, format="bgr8; jpeg compressed bgr8", data=picture.jpeg),
        )
        self.publish(self._camera_info_publisher, info)
        if self._raw is not None:
            self._publish_raw(picture, header)

    def _publish_raw(self, picture: Picture, header: Header) -> None:
        image = decode_jpeg(picture.jpeg)
        if image is None:
            return
        height, width = image.shape[:2]
        message = Image(header=header, height=height, width=width, encoding="bgr8", step=3 * width)
        message.data = image.tobytes()
        self.publish(self._raw, message)


def main() -> None:
    """Entry point."""
    run(CameraNode, "camera")


if __name__ == "__main__":
    main()
