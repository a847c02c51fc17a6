# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Processor time of publishing a message that rclpy makes and converts, and of one that is written into its bytes.

    python src/fish_node/benchmarks/message_cost.py

Nobody listens, so that the middleware's share is small. The smallest of ROUNDS means counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

from fish_node.nodes.message_bytes import MessageBytes, mark

MESSAGES, ROUNDS, DOMAIN = 1000, 7, 172
STAMP = Time(sec=1, nanosec=2)


def odometry(numbers: tuple[float, ...]) -> Odometry:
    """With a position, a velocity and both covariances."""
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = STAMP, "pool"
    message.pose.pose.position.x, message.pose.pose.position.y = numbers[:2]
    message.twist.twist.linear.x = numbers[2]
    message.pose.covariance, message.twist.covariance = numbers[3:39], numbers[39:75]
    return message


def imu(numbers: tuple[float, ...]) -> Imu:
    """With orientation, rates and specific force."""
    message = Imu()
    message.header.stamp, message.header.frame_id = STAMP, "imu_link"
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    q.z, q.w, w.x, w.y, w.z, a.x, a.y, a.z = numbers
    return message


def command(numbers: tuple[float, ...]) -> JointState:
    """As joint_command."""
    message = JointState(name=["rotor", "rudder"], position=numbers[:2], velocity=numbers[2:])
    message.header.stamp = STAMP
    return message


def cost(publish: Callable[[], None]) -> float:
    """Processor time of one call [s]."""
    means = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(MESSAGES):
            publish()
        means.append((time.process_time() - start) / MESSAGES)
    return min(means)


def main() -> None:
    """Print a line for each kind of message."""
    rclpy.init(domain_id=DOMAIN)
    node = Node("talker")
    print(f"{'message':12} {'rclpy, us':>10} {'bytes, us':>10}")
    kinds = ((Odometry, odometry, 75), (Imu, imu, 8), (JointState, command, 4))
    for number, (kind, make, count) in enumerate(kinds):
        publisher = node.create_publisher(kind, f"topic_{number}", 10)
        numbers = tuple(0.1 * (k + 1) for k in range(count))
        written = MessageBytes(make(tuple(map(mark, range(count)))), count)
        slow = cost(lambda p=publisher, m=make, n=numbers: p.publish(m(n)))
        fast = cost(lambda p=publisher, w=written, n=numbers: p.publish(w(STAMP, n)))
        print(f"{kind.__name__:12} {1e6 * slow:10.0f} {1e6 * fast:10.0f}")
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
