# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker node: overhead image to pose of the head and angles of the tail.

In: camera/image_raw/compressed (sensor_msgs/CompressedImage) or, with use_raw, camera/image_raw
(sensor_msgs/Image, from a reliable publisher); camera/camera_info (sensor_msgs/CameraInfo). Out: camera/pose
(geometry_msgs/PoseWithCovarianceStamped, frame pool), camera/tail (sensor_msgs/JointState, tail_1 .. relative
angles, rad), both stamped as the image; with debug_image camera/debug/compressed; lockstep (std_msgs/Header, where somebody
listens: an image that gives no pose, so that a simulator does not wait for it); /diagnostics. Bad images
and calibrations are counted and said in the diagnostics. An image that is the same as the one before gives no pose: a fish
that is followed in a frozen image would be another one when the camera goes on.
"""

from collections.abc import Callable
from math import cos, sin
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from fish_node.nodes.frames import publish_static_frame
from fish_node.nodes.heap import keep_freed_memory
from fish_node.nodes.parameters import Changes
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import read_parameters, run
from fish_node.nodes.status_log import StatusLog
from fish_node.rivals import Rivals
from fish_vision.annotate import annotated
from fish_vision.calibration import Calibration, CalibrationError, Lens
from fish_vision.choice import Reason
from fish_vision.config import TrackerConfig
from fish_vision.detections import PoseLowPass, Statistics
from fish_vision.follower import Follower, make_follower
from fish_vision.picture import PictureError, Repeats, from_compressed, from_raw, to_jpeg
from fish_vision.tracker import Detection, Lost

SETTABLE = ("front_colour", "rear_colour", "tail_odd_colour", "tail_even_colour")
NO_INFO = "no camera/camera_info yet"
NO_POSE = "tracker"  # who says on lockstep that an image gives no pose
QUEUE = 10
# a late image is worse than a lost one; a raw image is many packets, of which best effort sooner or later loses one
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
NEWEST_RAW = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
UNKNOWN = 1e6  # variance of what an overhead camera does not see: z, roll, pitch


class TrackerNode(Node):
    """Messages in and out; the work is in Tracker."""

    def __init__(self) -> None:
        super().__init__(
            "tracker", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        cv2.setNumThreads(
            1
        )  # one small region per image: more threads only take time from other nodes
        self._config = read_parameters(self, TrackerConfig, SETTABLE)
        Changes(self, self._config, self._change)
        self._info: tuple[Any, ...] | None = None  # fields of the camera_info in use
        self._calibration: Calibration | None = None
        self._calibration_error = NO_INFO
        self._tracker: Follower | None = None
        self._lowpass = PoseLowPass(self._config.lowpass_hz, self._config.reacquire_s)
        self._statistics = Statistics()
        self._repeats = Repeats()
        self._images_before = self._tracked_before = 0
        self._mounted = publish_static_frame(
            self,
            self._config.frame_id,
            self._config.frame_prefix + self._config.camera_frame,
            self._config.camera_position,
            self._config.mount().quaternion,
        )
        self._pose = self.create_publisher(PoseWithCovarianceStamped, "camera/pose", QUEUE)
        self._tail = self.create_publisher(JointState, "camera/tail", QUEUE)
        self._debug = None
        if self._config.debug_image:
            self._debug = self.create_publisher(CompressedImage, "camera/debug/compressed", QUEUE)
        self._lockstep = self.create_publisher(Header, "lockstep", QUEUE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUE)
        self._log = StatusLog(self.get_logger())
        self._rivals = Rivals(
            self._pose.topic_name, self.count_publishers, self.get_logger().warning
        )
        self.create_subscription(
            CameraInfo, "camera/camera_info", self._on_info, qos_profile_sensor_data
        )
        if self._config.use_raw:
            self.create_subscription(Image, "camera/image_raw", self._on_image, NEWEST_RAW)
        else:
            self.create_subscription(
                CompressedImage, "camera/image_raw/compressed", self._on_image, NEWEST
            )
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _change(self, _: TrackerConfig, after: TrackerConfig) -> Callable[[], None]:
        """What takes over colours that were set at run time: the fish is looked for anew."""

        def take_over() -> None:
            self._config = after
            if self._calibration is not None:
                self._tracker = make_follower(after, self._calibration)

        return take_over

    def _on_info(self, msg: CameraInfo) -> None:
        """Take over a calibration when it changes."""
        info = (msg.width, msg.height, msg.distortion_model, tuple(msg.k), tuple(msg.d))
        if info == self._info:
            return
        self._info, self._calibration, self._tracker = info, None, None
        try:
            self._calibration = self._config.calibration(Lens.from_camera_info(*info))
            self._tracker = make_follower(self._config, self._calibration)
        except CalibrationError as error:
            self._calibration_error = str(error)

    def _on_image(self, msg: CompressedImage | Image) -> None:
        start = perf_counter()
        if self._tracker is None or self._calibration is None:
            self._statistics.refuse("no calibration", self._calibration_error)
            return
        try:
            picture = self._picture(msg, self._calibration.lens.size)
        except PictureError as error:
            self._statistics.refuse("bad image", str(error))
            return
        stamp = msg.header.stamp.sec + msg.header.stamp.nanosec * 1e-9
        if self._repeats.seen(msg.data):
            found: Detection | Lost = Lost(stamp, Reason.REPEATED, None)
        else:
            found = self._tracker.track(picture, stamp)
        if isinstance(found, Detection):
            filtered = self._lowpass.filtered(found)
            self._publish(filtered, _earlier(msg.header, stamp - filtered.stamp))
        elif self._lockstep.get_subscription_count():
            self._lockstep.publish(Header(stamp=msg.header.stamp, frame_id=NO_POSE))
        age = self.get_clock().now().nanoseconds * 1e-9 - stamp
        self._statistics.add(found, perf_counter() - start, age)
        if self._debug is not None:
            drawn = annotated(picture, found, self._config, self._calibration)
            self._debug.publish(
                CompressedImage(header=msg.header, format="jpeg", data=to_jpeg(drawn))
            )

    def _picture(self, msg: CompressedImage | Image, size: tuple[int, int]) -> np.ndarray:
        if isinstance(msg, CompressedImage):
            return from_compressed(msg.data, size)
        return from_raw(msg.data, msg.encoding, msg.width, msg.height, msg.step, size)

    def _publish(self, found: Detection, header: Header) -> None:
        head, own = found.head, Header(stamp=header.stamp, frame_id=self._config.frame_id)
        msg = PoseWithCovarianceStamped(header=own)
        msg.pose.pose.position.x, msg.pose.pose.position.y = head.x, head.y
        msg.pose.pose.orientation.z = sin(head.heading / 2)
        msg.pose.pose.orientation.w = cos(head.heading / 2)
        covariance = np.diag([0.0, 0.0, UNKNOWN, UNKNOWN, UNKNOWN, 0.0])
        seen = np.ix_([0, 1, 5], [0, 1, 5])  # x, y, yaw
        covariance[seen] = head.covariance
        msg.pose.covariance = covariance.ravel()
        self._pose.publish(msg)
        if found.tail is not None:
            names = [f"tail_{i + 1}" for i in range(len(found.tail))]
            self._tail.publish(JointState(header=own, name=names, position=list(found.tail)))

    def _report(self) -> None:
        """Diagnostics, once a second."""
        level, message = self._state()
        self._log.say(level, message)
        if warning := self._rivals.warning():
            level, message = max(level, DiagnosticStatus.WARN), f"{message}; {warning}"
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name().lstrip("/"), level=level, message=message
        )
        status.hardware_id = "overhead camera"
        status.values = [
            KeyValue(key=key, value=value) for key, value in self._statistics.values().items()
        ]
        if self._tracker is not None and self._tracker.hue_shifts:
            shifts = " ".join(f"{name} {v:+.0f}" for name, v in self._tracker.hue_shifts.items())
            status.values.append(KeyValue(key="hue_shifts", value=shifts))
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp), status=[status]))

    def _state(self) -> tuple[bytes, str]:
        """Level and message for what came since the last report."""
        statistics = self._statistics
        images, tracked = (
            statistics.images - self._images_before,
            statistics.tracked - self._tracked_before,
        )
        self._images_before, self._tracked_before = statistics.images, statistics.tracked
        refused, statistics.last_error = statistics.last_error, ""
        if self._info is None:  # at the start; pictures without it are an error
            return (DiagnosticStatus.WARN if not images else DiagnosticStatus.ERROR), NO_INFO
        if self._calibration is None:
            return DiagnosticStatus.ERROR, self._calibration_error
        if refused:
            return DiagnosticStatus.ERROR, refused
        if (error := statistics.refused_spacing()) is not None:
            return DiagnosticStatus.ERROR, f"no poses: {self._scale(error)}"
        if images == 0:
            return DiagnosticStatus.WARN, "no image in the last second"
        if (error := statistics.spacing_error()) is not None:
            return DiagnosticStatus.WARN, self._scale(error)
        if tracked < images:
            return (
                DiagnosticStatus.WARN,
                f"fish seen in {tracked} of {images} images: {statistics.last_reason}",
            )
        return DiagnosticStatus.OK, f"fish seen in all {images} images"

    def _scale(self, error: float) -> str:
        """What a misfit (share) of the markers' known distance means, and what mends it."""
        assert self._calibration is not None
        size, height = 1.0 + error, self._config.camera_position[2] - self._config.marker_height
        focal = size * float(self._calibration.lens.K[0, 0])
        return (
            f"what is on the head seems {100 * error:+.1f} % too large: the focal length of camera_info is wrong "
            f"(focal_scale {size * self._config.focal_scale:.3f} corrects it to {focal:.0f} pixels), or the camera hangs "
            f"{height / size:.2f} m above the markers and not {height:.2f} m, or the markers' places are wrong"
        )


def _earlier(header: Header, delay: float) -> Header:
    """A header with a stamp that is delay (s) before that of another one."""
    if not delay:
        return header
    stamp = Time.from_msg(header.stamp) - Duration(nanoseconds=round(delay * 1e9))
    return Header(stamp=stamp.to_msg(), frame_id=header.frame_id)


def main() -> int:
    """Entry point."""
    keep_freed_memory()
    return run(TrackerNode, "tracker", spin=ByEvents())


if __name__ == "__main__":
    raise SystemExit(main())
