# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's calibration in ROS: camera_info from the file, and the service that replaces the file.

Service camera/set_camera_info (sensor_msgs/SetCameraInfo), which camera_calibration calls at its button COMMIT.
"""

import os
from pathlib import Path

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo
from sensor_msgs.srv import SetCameraInfo

from fish_hw.settings.camera import CameraSettings
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
