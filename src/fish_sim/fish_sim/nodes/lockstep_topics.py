# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who tells a simulator in lockstep how far they are.

In: odometry/filtered, and anybody who speaks on lockstep (std_msgs/Header: frame_id is who, stamp how far). With
lockstep_camera also camera/pose: on a busy computer camera and tracker lag by more than anything else, and poses that come
later and later look to fusion as if a clock had been set. The tracker says on lockstep which image gives no pose.
"""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from fish_node.nodes.quick_messages import read_stamp
from fish_sim.nodes.pacing import Lockstep

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
QUEUE = 10
POSES, TRACKER = "camera/pose", "tracker"


def hear_lockstep(
    node: Node, lockstep: Lockstep, simulated: Callable[[Time], float], camera: float
) -> None:
    """Subscribe to everybody who is waited for but the commander.

    Args:
        lockstep: is told who has answered.
        simulated: s of simulated time of a stamp.
        camera: s that camera/pose may come after its stamp; 0: it is not waited for.
    """

    def on_other(message: Header) -> None:
        time = simulated(message.stamp)
        if camera > 0.0 and message.frame_id == TRACKER:
            lockstep.answered(POSES, time + camera)
        else:
            lockstep.answered(message.frame_id, time)

    def on_odometry(data: bytes) -> None:
        lockstep.answered("odometry/filtered", simulated(read_stamp(data)))

    def on_pose(data: bytes) -> None:
        lockstep.answered(POSES, simulated(read_stamp(data)) + camera)

    node.create_subscription(Header, "lockstep", on_other, QUEUE)
    node.create_subscription(Odometry, "odometry/filtered", on_odometry, QUEUE, raw=True)
    if camera > 0.0:
        node.create_subscription(PoseWithCovarianceStamped, POSES, on_pose, NEWEST, raw=True)
