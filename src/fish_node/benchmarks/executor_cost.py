# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Processor time of a node that hears an IMU, with rclpy's executors and the one with a kept wait set, in the same run.

    python src/fish_node/benchmarks/executor_cost.py

A process publishes MESSAGES sensor_msgs/Imu at 100 Hz. A node in this process takes them, has a timer of 100 Hz and six
parameter services, as every node of the robot. The executors are measured in turns; the smallest time of each counts. The last
takes the messages from their bytes (quick_messages).
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Imu

from fish_node.nodes.executor import KeptWaitSetExecutor
from fish_node.nodes.quick_messages import from_bytes

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


def turn(executor: Executor) -> None:
    """Some callbacks; the wait of the EventsExecutor needs a limit."""
    if isinstance(executor, SingleThreadedExecutor):
        executor.spin_once()
    else:
        executor.spin_until_future_complete(Future(), 0.1)


def processor_time(make: Callable[[], Executor], raw: bool) -> tuple[float, int]:
    """Processor time [s] of hearing until the IMU is silent, and how many messages were heard."""
    peer = multiprocessing.get_context("spawn").Process(target=publish)
    rclpy.init(domain_id=DOMAIN)
    node, executor = Node("listener"), make()
    heard: list[None] = []

    def hear(_: object) -> None:
        heard.append(None)

    node.create_subscription(Imu, "imu/data", from_bytes(Imu, hear) if raw else hear, 10, raw=raw)
    node.create_timer(0.01, lambda: None)
    executor.add_node(node)
    peer.start()
    while not heard:
        turn(executor)
    start, begin = time.process_time(), time.monotonic()
    while time.monotonic() - begin < 0.01 * MESSAGES:
        turn(executor)
    used = (time.process_time() - start) / (time.monotonic() - begin)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    peer.join()
    return used, len(heard)


KINDS = {
    "rclpy's SingleThreadedExecutor": (SingleThreadedExecutor, False),
    "kept wait set": (KeptWaitSetExecutor, False),
    "rclpy's EventsExecutor": (EventsExecutor, False),
    "the same, from bytes": (EventsExecutor, True),
}


def main() -> None:
    """All in turns."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    best: dict[str, float] = {}
    for _ in range(ROUNDS):
        for name, (make, raw) in KINDS.items():
            used, heard = processor_time(make, raw)
            best[name] = min(best.get(name, 1.0), used)
            print(f"{name:30} {used:6.1%} of a core, {heard} messages")
    print("\n".join(f"{name:30} {used:6.1%} at best" for name, used in best.items()))


if __name__ == "__main__":
    main()
