# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes in one process, and the bytes that they publish."""

import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header

from fish_control.controller import Command
from fish_control.estimate import Estimate
from fish_control.line_of_sight import Motion
from fish_control.nodes.messages import (
    CommandBytes,
    OdometryBytes,
    PlanBytes,
    planar_covariance,
    yaw_of,
)
from fish_control.nodes.pilot import NODES, split_arguments
from fish_control.paths import make_path
from fish_control.planner import Planner

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


STAMP = Time(sec=12, nanosec=250_000_000)


def covariance(first: float) -> np.ndarray:
    return np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]) * first


def estimate(shift: float) -> Estimate:
    pose, twist = np.array([1.0, 2.0, 0.5]) + shift, np.array([0.3, 0.1, 0.7]) + shift
    return Estimate(
        12.25 + shift, pose, twist, covariance(1.0), covariance(10.0), 0.0, False, False
    )


def test_an_estimate_is_odometry_with_its_covariances() -> None:
    written = OdometryBytes("pool", "fish_2/base_link")
    written(estimate(3.0))  # what one message held is not in the next
    message = deserialize_message(written(estimate(0.0)), Odometry)
    assert message.header == Header(stamp=STAMP, frame_id="pool")
    assert message.child_frame_id == "fish_2/base_link"
    position, twist = message.pose.pose.position, message.twist.twist
    assert (position.x, position.y, position.z) == (1.0, 2.0, 0.0)
    assert yaw_of(message.pose.pose.orientation) == pytest.approx(0.5)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, 0.1, 0.7)
    for part, factor in ((message.pose, 1.0), (message.twist, 10.0)):
        np.testing.assert_array_equal(planar_covariance(part.covariance), covariance(factor))
        assert np.count_nonzero(part.covariance) == 9


def test_a_command_names_rotor_and_rudder() -> None:
    command = Command(phase=1.0, rotor_speed=80.0, alpha=-0.2)
    message = deserialize_message(CommandBytes()(STAMP, command), JointState)
    assert (message.header.stamp, message.name) == (STAMP, ["rotor", "rudder"])
    assert (list(message.position), list(message.velocity)) == ([1.0, -0.2], [80.0, 0.0])


def test_a_plan_is_a_target_a_twist_and_an_error() -> None:
    plan = Planner(make_path("circle", radius=0.5), 0.2).plan(
        Motion(0.4, 0.1, 1.2, 0.15, 0.02, 0.3)
    )
    written = PlanBytes("pool", "base_link")
    target = deserialize_message(written.target(STAMP, plan), PoseStamped)
    assert target.header == Header(stamp=STAMP, frame_id="pool")
    point = target.pose.position
    assert (point.x, point.y) == pytest.approx(tuple(plan.at.target))
    turned = yaw_of(target.pose.orientation) - plan.errors.course
    assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    twist = deserialize_message(written.twist(STAMP, plan), TwistStamped)
    assert twist.header == Header(stamp=STAMP, frame_id="base_link")
    assert (twist.twist.linear.x, twist.twist.angular.z) == (plan.speed, plan.yaw_rate)
    error = deserialize_message(written.error(STAMP, plan), Vector3Stamped).vector
    errors = plan.errors
    assert (error.x, error.y, error.z) == (errors.cross_track, errors.heading, errors.speed)
