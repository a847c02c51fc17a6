# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion, planner and controller in one process: sensors in, commands out, one end for all three."""

import os
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

from fish_control.nodes.pilot import NODES, split_arguments

pytestmark = pytest.mark.ros
DOMAIN = 174
LIMIT_S = 60.0  # of patience with a busy computer
PERIOD = 0.01  # s


def pilot(*words: str) -> subprocess.Popen:
    return subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from fish_control.nodes.entry import pilot as p; exit(p())",
            *words,
        ],
        env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def pool():
    """A node that says what sensors of a fish at rest would, and what it has heard of the three."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = Node("pool", namespace="fish_9", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard = set()
    for kind, topic in (
        (Odometry, "odometry/filtered"),
        (PoseStamped, "control/target"),
        (JointState, "joint_command"),
    ):
        node.create_subscription(kind, topic, lambda _, topic=topic: heard.add(topic), 10)
    imu = node.create_publisher(Imu, "imu/data", 10)
    camera = node.create_publisher(PoseWithCovarianceStamped, "camera/pose", 10)

    def sense():
        stamp = node.get_clock().now().to_msg()
        for publisher, message in ((imu, Imu()), (camera, PoseWithCovarianceStamped())):
            message.header.stamp = stamp
            publisher.publish(message)

    node.create_timer(PERIOD, sense)
    yield node, executor, heard
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_sensors_reach_the_command_through_one_process(pool, tmp_path):
    node, executor, heard = pool
    state = f"state_file:={tmp_path / 'progress.json'}"
    own = ("--planner", "-p", "path:=S", "-p", state, "--all", "-r", "__ns:=/fish_9")
    with pilot("--ros-args", *own) as process:
        end = time.monotonic() + LIMIT_S
        names = {}
        while (len(heard) < 3 or not set(NODES) <= set(names)) and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
            names = dict(node.get_node_names_and_namespaces())
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    assert heard == {"odometry/filtered", "control/target", "joint_command"}
    assert {names.get(name) for name in NODES} == {"/fish_9"}
    assert process.returncode == 0
    assert "Traceback" not in errors
    assert not list(tmp_path.iterdir())  # a planner that ends as it should leaves no progress


def test_what_one_of_the_three_refuses_ends_all_with_one_line():
    with pilot("--planner", "-p", "speed:=9.0") as process:
        _, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    assert errors.splitlines()[-1] == "planner: speed is 9.0 m/s, expected 0.05 to 0.5 m/s"


def test_each_node_has_its_own_arguments_and_those_for_all():
    words = "--ros-args -r a:=b --planner --ros-args -p path:=S --all --ros-args -r c:=d"
    common, own = split_arguments(words.split())
    assert common == ["--ros-args", "-r", "a:=b", "-r", "c:=d"]
    assert own == {
        "fusion": ["--ros-args"],
        "planner": ["--ros-args", "-p", "path:=S"],
        "controller": ["--ros-args"],
    }
