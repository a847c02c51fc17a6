# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `camera`: the overhead USB camera.

Out: camera/image_raw/compressed (JPEG), camera/camera_info (same stamp and frame), camera/image_raw on
     request,
     /diagnostics
Service: camera/set_camera_info (sensor_msgs/SetCameraInfo), which camera_calibration calls at its button COMMIT: it
     replaces the calibration's file
"""

import os
from pathlib import Path

from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo
from std_msgs.msg import Header

from fish_hw.devices.usb_camera import FrameSource, Picture, UsbCamera, decode_jpeg
from fish_hw.emulators.walking_square import WalkingSquare
from fish_hw.nodes.device_node import DeviceNode, run
from fish_hw.settings import CameraSettings
from fish_hw.transport.unix_socket import PREFIX, SocketCamera
from fish_hw.transport.video_capture import VideoCapture
from fish_node.camera_file import CameraFile, CameraFileError, read_camera_file, write_camera_file


class Calibration:
    """What the camera node knows of its lens.

    Attributes:
        info: camera_info without a header; K[0] = 0 says "not calibrated" (sensor_msgs/CameraInfo).

    Raises:
        CameraFileError: the file cannot be used, or is for another size of picture.
    """

    def __init__(self, node: Node, settings: CameraSettings) -> None:
        self._node, self._settings = node, settings
        self._file = Path(settings.calibration_file or usual_file(settings.frame_id)).expanduser()
        self.info = CameraInfo(width=settings.width, height=settings.height)
        if settings.calibration_file:
            self.info = to_message(self._fitting(read_camera_file(self._file)))
        else:
            node.get_logger().warning(
                "no calibration_file: camera_info is published without calibration"
            )
        node.create_service(SetCameraInfo, "camera/set_camera_info", self._on_set)

    def _on_set(
        self, request: SetCameraInfo.Request, response: SetCameraInfo.Response
    ) -> SetCameraInfo.Response:
        try:
            camera = self._fitting(from_message(request.camera_info))
            write_camera_file(self._file, camera, self._settings.frame_id)
        except CameraFileError as error:
            response.success, response.status_message = False, str(error)
            return response
        self.info = to_message(camera)
        response.success, response.status_message = True, f"saved in {self._file}"
        if not self._settings.calibration_file:
            response.status_message += (
                "; set calibration_file to it, so that the next start reads it"
            )
        self._node.get_logger().info(response.status_message)
        return response

    def _fitting(self, camera: CameraFile) -> CameraFile:
        """The camera, if it is for pictures of the size that is set."""
        settings = self._settings
        file = f" {settings.calibration_file}" if settings.calibration_file else ""
        if (camera.width, camera.height) != (settings.width, settings.height):
            raise CameraFileError(
                f"calibration{file} is for {camera.width}x{camera.height} px,"
                f" the camera is set to {settings.width}x{settings.height}:"
                " calibrate again or change the size"
            )
        return camera


def usual_file(name: str) -> str:
    """Where camera_info_manager keeps the calibration of a camera."""
    return f"{os.environ.get('ROS_HOME') or '~/.ros'}/camera_info/{name}.yaml"


def to_message(camera: CameraFile) -> CameraInfo:
    """A calibrated camera as camera_info, without a header."""
    return CameraInfo(
        width=camera.width,
        height=camera.height,
        distortion_model=camera.model,
        d=camera.distortion,
        k=camera.camera_matrix,
        r=camera.rectification,
        p=camera.projection,
    )


def from_message(info: CameraInfo) -> CameraFile:
    """The camera of a camera_info; its numbers are not checked."""
    return CameraFile(
        info.width,
        info.height,
        info.distortion_model,
        tuple(info.d),
        tuple(info.k),
        tuple(info.r),
        tuple(info.p),
    )


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
            return SocketCamera(self.settings.device, self.clock.own)
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
