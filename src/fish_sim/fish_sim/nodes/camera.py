# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overhead camera of the simulated pool.

In: sim/odometry (nav_msgs/Odometry, pose of the head in the pool), sim/joint_states (sensor_msgs/JointState,
tail_1 .. relative angles, rad; straight tail without it). Out: camera/image_raw/compressed
(sensor_msgs/CompressedImage, JPEG), camera/camera_info (sensor_msgs/CameraInfo) and, if asked,
camera/image_raw (sensor_msgs/Image, bgr8), all with the middle of the exposure as stamp, `latency_s` after
it; /diagnostics.
"""

from collections import deque
from dataclasses import dataclass
from math import atan2, ceil

import cv2
import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from fish_node.nodes.heap import keep_freed_memory
from fish_node.nodes.quick_messages import hear
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import read_parameters, run
from fish_node.nodes.status_log import StatusLog
from fish_sim.camera.config import CameraConfig
from fish_sim.camera.fish import FishPose
from fish_sim.camera.model import FrameClock, History
from fish_sim.camera.renderer import PoolRenderer

QUEUE = 10
KEPT = 100  # messages of the simulation: a picture drawn between two samples that are far apart shows a wrong heading
LATE = 0.1  # s; a picture that would come later than this after its time is not drawn
BLUR_STEP = 0.002  # s of exposure per drawn pose
CLOCK_MISMATCH = 1.0  # s between odometry stamp and own clock that is worth a warning


@dataclass(frozen=True)
class Frame:
    """An encoded picture that waits for its time of arrival."""

    release_ns: int
    info: CameraInfo
    compressed: CompressedImage
    raw: Image | None


class CameraNode(Node):
    """Draws the fish where the simulation says it was and sends the picture as late as a camera would."""

    def __init__(self) -> None:
        super().__init__(
            "camera", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        cv2.setNumThreads(1)  # a second thread waits busily for small pieces of work
        self._config = config = read_parameters(self, CameraConfig)
        self._renderer = PoolRenderer(config.model(), config.shape(), config.look())
        self._random = np.random.default_rng(config.seed + 1)
        self._clock_of_frames = FrameClock(config.rate_hz)
        self._head, self._tail = History(angles=(2,)), History()
        self._waiting: deque[Frame] = deque()
        self._sent = self._dropped = self._sent_before = 0
        self._clock_error = 0.0
        self._compressed = self.create_publisher(
            CompressedImage, "camera/image_raw/compressed", QUEUE
        )
        self._raw = (
            self.create_publisher(Image, "camera/image_raw", QUEUE) if config.publish_raw else None
        )
        self._info = self.create_publisher(CameraInfo, "camera/camera_info", QUEUE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUE)
        self._log = StatusLog(self.get_logger())
        self.create_subscription(JointState, "sim/joint_states", self._on_joints, KEPT)
        hear(self, Odometry, "sim/odometry", self._on_odometry, KEPT)
        self._release = self.create_timer(1.0, self._send_due)  # armed for each frame
        self._release.cancel()
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_joints(self, msg: JointState) -> None:
        angles = dict(zip(msg.name, msg.position, strict=False))
        names = [f"tail_{i}" for i in range(1, self._config.tail_links + 1)]
        tail = np.array([angles.get(name, 0.0) for name in names])
        if np.all(np.isfinite(tail)):
            self._tail.add(_seconds(msg.header), tail)

    def _on_odometry(self, msg: Odometry) -> None:
        p, q = msg.pose.pose.position, msg.pose.pose.orientation
        heading = atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        state = np.array([p.x, p.y, heading])
        if not np.all(np.isfinite(state)):
            return
        time = _seconds(msg.header)
        self._head.add(time, state)
        self._clock_error = self.get_clock().now().nanoseconds * 1e-9 - time
        middle = time - self._config.exposure_s / 2
        if middle < 0.0:  # of an exposure that began before time did: no stamp says that
            return
        exposure = self._clock_of_frames.due(middle)
        if exposure is None or self._too_late(exposure):
            return
        if self._random.random() < self._config.drop_rate:
            self._dropped += 1
            return
        self._waiting.append(self._take(exposure))
        self._send_due()

    def _too_late(self, exposure: float) -> bool:
        """Whether this computer is so busy that a picture would only make the next ones late."""
        late = self.get_clock().now().nanoseconds * 1e-9 - exposure - self._config.latency_s
        if not LATE < late < CLOCK_MISMATCH:
            return False
        self._clock_of_frames.skipped += 1
        return True

    def _take(self, exposure: float) -> Frame:
        """Draw and encode the frame whose exposure is centred at a time."""
        picture = self._renderer.render(self._poses(exposure), exposure)
        frame = self._config.frame_prefix + self._config.frame_id
        header = Header(stamp=Time(seconds=exposure).to_msg(), frame_id=frame)
        compressed = CompressedImage(header=header, format="bgr8; jpeg compressed bgr8")
        compressed.data = self._renderer.jpeg(picture)
        raw = _raw_image(header, picture) if self._raw is not None else None
        release = Time(seconds=exposure + self._config.latency_s).nanoseconds
        return Frame(release, self._camera_info(header), compressed, raw)

    def _poses(self, exposure: float) -> list[FishPose]:
        """The fish at equal parts of the exposure."""
        shutter = self._config.exposure_s
        count = max(1, ceil(shutter / BLUR_STEP))
        times = exposure + shutter * ((np.arange(count) + 0.5) / count - 0.5)
        poses = []
        for time in times:
            head, tail = self._head.at(time), self._tail.at(time)
            assert head is not None  # a frame is taken only after odometry came
            x, y, psi = map(float, head)
            poses.append(FishPose(x, y, psi, tail=() if tail is None else tuple(map(float, tail))))
        return poses

    def _send_due(self) -> None:
        """Publish the frames whose time has come and arm the timer for the next one."""
        self._release.cancel()
        while self._waiting:
            wait = self._waiting[0].release_ns - self.get_clock().now().nanoseconds
            if 0 < wait <= self._config.latency_s * 1e9:
                self._release.timer_period_ns = wait
                self._release.reset()
                return
            self._send(self._waiting.popleft())

    def _send(self, frame: Frame) -> None:
        self._info.publish(frame.info)
        self._compressed.publish(frame.compressed)
        if self._raw is not None and frame.raw is not None:
            self._raw.publish(frame.raw)
        self._sent += 1

    def _camera_info(self, header: Header) -> CameraInfo:
        camera = self._renderer.camera
        info = CameraInfo(header=header, distortion_model="plumb_bob")
        info.width, info.height = camera.size
        info.k, info.d = camera.K.ravel(), camera.D.tolist()
        info.r = np.eye(3).ravel()
        info.p = np.column_stack([camera.K, np.zeros(3)]).ravel()
        return info

    def _report(self) -> None:
        """Diagnostics, once a second."""
        rate, self._sent_before = self._sent - self._sent_before, self._sent
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name().lstrip("/"), hardware_id="simulated camera"
        )
        status.level, status.message = DiagnosticStatus.OK, "running"
        if self._head.at(0.0) is None:
            status.level, status.message = DiagnosticStatus.WARN, "no sim/odometry yet"
        elif abs(self._clock_error) > CLOCK_MISMATCH:
            status.level = DiagnosticStatus.WARN
            status.message = (
                f"own clock is {self._clock_error:.1f} s ahead of sim/odometry: "
                "set use_sim_time as for the simulator"
            )
        elif rate == 0:
            status.level, status.message = DiagnosticStatus.WARN, "no frame in the last second"
        self._log.say(status.level, status.message)
        counts = {"frames_per_second": rate, "sent": self._sent, "dropped": self._dropped}
        counts["skipped"] = self._clock_of_frames.skipped
        status.values = [KeyValue(key=key, value=str(value)) for key, value in counts.items()]
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp), status=[status]))


def _seconds(header: Header) -> float:
    return float(header.stamp.sec + header.stamp.nanosec * 1e-9)


def _raw_image(header: Header, picture: np.ndarray) -> Image:
    """bgr8 message; bytes, because rclpy copies an array element by element."""
    height, width, channels = picture.shape
    msg = Image(header=header, height=height, width=width, encoding="bgr8", step=width * channels)
    msg.data = picture.tobytes()
    return msg


def main() -> int:
    """Entry point."""
    keep_freed_memory()
    return run(CameraNode, "camera", spin=ByEvents())


if __name__ == "__main__":
    raise SystemExit(main())
