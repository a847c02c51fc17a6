# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""camera/pose + imu/data -> odometry/filtered (100 Hz, pool -> base_link), /diagnostics.

The variance of the pose grows while the camera is lost; a twist variance of 1e4 says that the IMU is lost. What a message
calls not measured is used nowhere: an IMU's first covariance of -1 (sensor_msgs), a pose's variance of x, y or yaw below 0.
Neither are poses of another frame than the pool's. The transform pool -> base_link and the static base_link -> imu_link are
broadcast where tf2_msgs is installed. Decisions are in Fusion.
"""

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from fish_control.estimate import Estimate
from fish_control.fusion import Fusion
from fish_control.fusion_status import (
    clock_values,
    clock_warning,
    implausible_sample,
    lost_sensors,
)
from fish_control.node_configs import FusionNodeConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    OdometryBytes,
    Reporter,
    inertial_values,
    planar_covariance,
    seconds,
    to_quaternion,
    to_stamp,
    yaw_of,
)
from fish_node.nodes.frames import FrameBroadcaster, publish_static_frame
from fish_node.nodes.quick_messages import hear
from fish_node.nodes.robot_clock import timer_clock
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import read_parameters, run
from fish_node.pool import FARTHEST

# why fusion does not use a pose, as it counts it -> the reason and what to change
REFUSALS = {
    "pose_not_measured": (
        "its poses say by a variance below 0 that x, y or yaw is not measured",
        "a tracker that does not know its noise leaves the variances at 0",
    ),
    "pose_no_covariance": (
        "what its poses give as covariance is none: not symmetric, or with a negative variance in some direction",
        "publish variances on the diagonal",
    ),
    "pose_not_finite": (
        "its poses are not finite, or their quaternion has no length",
        "a tracker that sees no fish publishes no pose",
    ),
    "pose_implausible": (
        f"its poses are more than {FARTHEST:g} m from the pool's origin along x or y",
        "set the tracker's unit to metres and its origin in the pool",
    ),
}
SENSORS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class FusionNode(Node):
    """Topics in and out of Fusion."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "fusion",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        config = read_parameters(self, FusionNodeConfig)
        self._fusion = Fusion(config)
        self._frames = config.pool_frame, config.frame_prefix + config.body_frame
        self._imu_frame = publish_static_frame(
            self, self._frames[1], config.frame_prefix + config.imu_frame
        )
        self._odometry = self.create_publisher(Odometry, "odometry/filtered", 10)
        self._written = OdometryBytes(*self._frames)
        self._transform = FrameBroadcaster(self)
        self._reporter = Reporter(self, self._odometry)
        hear(self, Imu, "imu/data", self._on_imu, SENSORS)
        hear(self, PoseWithCovarianceStamped, "camera/pose", self._on_pose, SENSORS)
        self.create_timer(1.0, lambda: self._report(self._estimate()), clock=timer_clock(self))
        self._used = 0.0  # s on this node's clock, when a measurement was last used
        self._said = ""
        self._refusal = ""  # why the poses since the last used one are not fused
        self._logged: set[str] = set()  # remedies of refusals: each is logged once

    def _on_imu(self, message: Imu) -> None:
        values = inertial_values(message)
        if self._fusion.add_imu(seconds(message.header.stamp), *values):
            self._used = self._now()
            self._publish(self._fusion.estimate())
        elif self._fusion.refused == "imu_implausible":
            wrong = implausible_sample(values, self._fusion.config)
            self._log_once(
                f"imu/data is not fused: {wrong}",
                "check its units; largest_yaw_rate and largest_accel are parameters",
            )

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        frame = message.header.frame_id
        if frame not in ("", self._frames[0]):
            self._fusion.counts["pose_wrong_frame"] += 1
            self._refuse(
                f"its poses come in frame {frame[:60]!r}, not in {self._frames[0]!r}",
                "set the tracker's frame or transform the poses",
            )
            return
        time, p = seconds(message.header.stamp), message.pose.pose
        pose = np.array([p.position.x, p.position.y, yaw_of(p.orientation)])
        covariance = planar_covariance(message.pose.covariance)
        if self._fusion.add_pose(time, pose, covariance):
            self._used, self._refusal = self._now(), ""
        elif self._fusion.refused in REFUSALS:
            seen = "; x {:g} m, y {:g} m, yaw {:g} rad".format(*pose)
            self._refuse(*REFUSALS[self._fusion.refused], seen)
        if self._fusion.imu_lost(self._silence()):  # no IMU message will publish the estimate
            self._publish(self._estimate())

    def _refuse(self, reason: str, remedy: str, seen: str = "") -> None:
        """Note why a pose is not fused; the first of its kind is logged, with what it says."""
        self._refusal = reason
        self._log_once(f"camera/pose is not fused: {reason}{seen}", remedy)

    def _log_once(self, problem: str, remedy: str) -> None:
        if remedy not in self._logged:
            self._logged.add(remedy)
            self.get_logger().error(f"{problem}; {remedy}")

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def _estimate(self) -> Estimate | None:
        """Lost is what is silent for too long, even where the sensors' clock is not this node's."""
        return self._fusion.estimate(self._silence())

    def _silence(self) -> float:
        """s since a measurement was used; a clock that was set back does not vouch for what is silent."""
        now = self._now()
        self._used = min(self._used, now)
        return now - self._used

    def _publish(self, estimate: Estimate | None) -> None:
        if estimate is None:
            return
        self._odometry.publish(self._written(estimate))
        if self._transform.heard:
            self._transform.send(to_transform(estimate, *self._frames))
        if self._state(estimate)[1] != self._said:
            self._report(estimate)

    def _state(self, estimate: Estimate | None) -> tuple[bytes, str]:
        lost = [] if estimate is None else lost_sensors(estimate)
        if self._refusal and (estimate is None or estimate.camera_lost):
            return ERROR, f"camera lost: {self._refusal}"
        if estimate is None:
            return WARN, "waiting for camera poses that agree"
        if lost:
            return ERROR, f"{' and '.join(lost)} lost"
        warning = clock_warning(self._fusion)
        return (WARN, f"estimating; {warning}") if warning else (OK, "estimating")

    def _report(self, estimate: Estimate | None) -> None:
        level, self._said = self._state(estimate)
        values: dict[str, object] = {**self._fusion.counts, **clock_values(self._fusion)}
        if estimate is not None:
            values["gyro_bias_rad_s"] = f"{estimate.gyro_bias:.5f}"
            values["position_std_m"] = f"{np.sqrt(estimate.pose_covariance[0, 0]):.4f}"
        self._reporter.report(level, self._said, values)


def to_transform(estimate: Estimate, pool_frame: str, body_frame: str) -> TransformStamped:
    """pool -> base_link."""
    message = TransformStamped(child_frame_id=body_frame)
    message.header.frame_id, message.header.stamp = pool_frame, to_stamp(estimate.time)
    translation = message.transform.translation
    translation.x, translation.y = map(float, estimate.pose[:2])
    message.transform.rotation = to_quaternion(float(estimate.pose[2]))
    return message


def main() -> int:
    """Entry point."""
    return run(FusionNode, "fusion", spin=ByEvents())
