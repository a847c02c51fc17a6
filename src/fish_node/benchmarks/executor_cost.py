# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Processor time of a node that hears an IMU, compared with rclpy's own executor in the same run.

    python src/fish_node/benchmarks/executor_cost.py

A process publishes MESSAGES sensor_msgs/Imu at 100 Hz. A node in this process takes them, has a timer of 100 Hz and six
parameter services, as every node of the robot. The two executors are measured in turns; the smallest time of each counts.
"""

from __future__ import annotations

import multiprocessing
import os
import time

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Imu

from fish_node.nodes.executor import KeptWaitSetExecutor

MESSAGES, ROUNDS, DOMAIN = 500, 3, 171


def publish() -> None:
    """The IMU: MESSAGES at 100 Hz once somebody listens."""
    rclpy.init(domain_id=DOMAIN)
    node = Node("imu_peer")
    publisher = node.create_publisher(Imu, "imu/data", 10)
    while not publisher.get_subscription_count():
        time.sleep(0.05)
    for _ in range(MESSAGES):
        publisher.publish(Imu())
        time.sleep(0.01)
    time.sleep(0.5)
    node.destroy_node()
    rclpy.shutdown()


def processor_time(make: type[Executor]) -> tuple[float, int]:
    """Processor time [s] of hearing until the IMU is silent, and how many messages were heard."""
    peer = multiprocessing.get_context("spawn").Process(target=publish)
    rclpy.init(domain_id=DOMAIN)
    node, executor = Node("listener"), make()
    heard: list[None] = []
    node.create_subscription(Imu, "imu/data", lambda _: heard.append(None), 10)
    node.create_timer(0.01, lambda: None)
    executor.add_node(node)
    peer.start()
    while not heard:
        executor.spin_once()
    start, begin = time.process_time(), time.monotonic()
    while time.monotonic() - begin < 0.01 * MESSAGES:
        executor.spin_once()
    used = (time.process_time() - start) / (time.monotonic() - begin)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    peer.join()
    return used, len(heard)


def main() -> None:
    """Both in turns."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    best: dict[type[Executor], float] = {}
    for _ in range(ROUNDS):
        for kind in (SingleThreadedExecutor, KeptWaitSetExecutor):
            used, heard = processor_time(kind)
            best[kind] = min(best.get(kind, 1.0), used)
            print(f"{kind.__name__:24} {used:6.1%} of a core, {heard} messages")
    kept, usual = best[KeptWaitSetExecutor], best[SingleThreadedExecutor]
    print(f"kept wait set: {kept:.1%} of a core, rclpy's: {usual:.1%}; ratio {usual / kept:.1f}")


if __name__ == "__main__":
    main()
