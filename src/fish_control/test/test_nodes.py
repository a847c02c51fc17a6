# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nodes in one process: topics, frames, units, faults; and how they start and end as programs."""

import json
import math
import subprocess
import sys
import tempfile
import time
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    Twist,
    TwistStamped,
    Vector3,
    Vector3Stamped,
)
from nav_msgs.msg import Odometry, Path
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, String
from std_srvs.srv import Trigger

from fish_control.estimate import LOST_VARIANCE
from fish_control.nodes import controller, exciter, fusion, planner
from fish_control.nodes.controller import ControllerNode
from fish_control.nodes.exciter import ExciterNode
from fish_control.nodes.fusion import FusionNode
from fish_control.nodes.messages import inertial_values, seconds, to_quaternion, to_stamp, yaw_of
from fish_control.nodes.planner import PlannerNode
from fish_node import rivals

pytestmark = pytest.mark.ros
PERIOD = 0.01  # s, of commands
AGE = 0.005  # s, of an estimate when the controller commands
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Bench:
    """A node under test beside one that talks to it and keeps what it hears."""

    def __init__(self, make_node, **parameters):
        self.other = Node("bench", namespace="fish")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.other)
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.node = make_node(parameter_overrides=overrides)
        self.executor.add_node(self.node)
        self.heard = {}
        self.time = 100.0  # s, of simulated time
        self._publishers = {}
        self.listen("/diagnostics", DiagnosticArray)

    def listen(self, topic, kind, qos=10):
        self.heard[topic] = []
        self.other.create_subscription(kind, topic, self.heard[topic].append, qos)

    def say(self, topic, message, qos=10):
        if topic not in self._publishers:
            publisher = self._publishers[topic] = self.other.create_publisher(
                type(message), topic, qos
            )
            self.until(lambda: publisher.get_subscription_count() > 0)
        self._publishers[topic].publish(message)

    def until(self, condition, seconds=10.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, (
                f"not within {seconds} s; heard { ({k: len(v) for k, v in self.heard.items()}) }"
            )
            self.executor.spin_once(timeout_sec=0.02)

    def spin(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.005)

    def tick(self, before=lambda time: None):
        """One period of simulated time: what `before` says of it, then the clock, until the node has acted on it."""
        self.time += PERIOD
        before(self.time)
        self.say("/clock", Clock(clock=to_stamp(self.time)))
        self.until(lambda: self.node._now > self.time - 0.5 * PERIOD)

    def now(self):
        return self.other.get_clock().now().nanoseconds * 1e-9

    def said(self, level, text):
        """Whether the newest status of the node's diagnostics is this."""
        own = self.node.get_fully_qualified_name().lstrip("/")
        statuses = [
            s for array in self.heard["/diagnostics"] for s in array.status if s.name == own
        ]
        return bool(statuses) and statuses[-1].level == level and text in statuses[-1].message

    def values(self):
        """Of the newest status on /diagnostics."""
        newest = self.heard["/diagnostics"][-1:]
        return {pair.key: pair.value for array in newest for pair in array.status[0].values}

    def close(self):
        """A node that a test took out of the executor ends, too: the next test would meet it as a rival."""
        self.executor.shutdown()
        for node in (self.node, self.other):
            node.destroy_node()


@pytest.fixture(autouse=True)
def graph(monkeypatch):
    """A domain of its own."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "140")  # above those that tests of other packages draw
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def bench(graph, tmp_path):
    rclpy.init()
    made = []

    def make(kind, **parameters):
        if kind in (ControllerNode, ExciterNode):
            parameters = {"arming_required": False, **parameters}
        if kind is PlannerNode:
            parameters = {"state_file": str(tmp_path / "progress.json"), **parameters}
        made.append(Bench(kind, **parameters))
        return made[-1]

    yield make
    for each in made:
        each.close()
    rclpy.try_shutdown()


def odometry(time, x=0.0, y=0.0, yaw=0.0, u=0.2, variance=1e-5, twist_variance=1e-4):
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id, message.header.stamp = "pool", to_stamp(time)
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation = to_quaternion(yaw)
    message.twist.twist.linear.x = u
    message.pose.covariance = (np.eye(6) * variance).ravel()
    message.twist.covariance = (np.eye(6) * twist_variance).ravel()
    return message


def feed_fusion(bench, start, seconds, camera=True, imu=True, frame="pool", unmeasured=None):
    """A fish that swims ahead at 0.2 m/s, in stamps that run ahead of the clock as fast as they are said."""
    for k in range(int(seconds * 100)):
        t = start + 0.01 * k
        if imu:
            sample = Imu()
            sample.header.stamp, sample.header.frame_id = to_stamp(t), "imu_link"
            sample.linear_acceleration.z = 9.81
            taken = bench.node._fusion.counts["imu"]
            bench.say("imu/data", sample)
            bench.until(
                lambda taken=taken: bench.node._fusion.counts["imu"] > taken
            )  # else poses overtake it
        if camera and k % 3 == 0:
            pose = PoseWithCovarianceStamped()
            pose.header.stamp, pose.header.frame_id = to_stamp(t), frame
            pose.pose.pose.position.x = 0.2 * (t - start)
            pose.pose.pose.orientation = to_quaternion(0.0)
            if unmeasured is not None:
                pose.pose.covariance[unmeasured] = -1.0
            bench.say("camera/pose", pose)
        bench.executor.spin_once(timeout_sec=0.001)
        bench.executor.spin_once(timeout_sec=0.001)


def test_fusion_publishes_odometry_in_the_pool_at_the_imu_s_stamps(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    start = b.now()
    feed_fusion(b, start, 2.5)
    b.spin(0.2)
    last = b.heard["odometry/filtered"][-1]
    t = seconds(last.header.stamp) - start
    assert (last.header.frame_id, last.child_frame_id) == ("pool", "base_link")
    assert last.pose.pose.position.x == pytest.approx(0.2 * t, abs=0.02)
    assert yaw_of(last.pose.pose.orientation) == pytest.approx(0.0, abs=0.05)
    assert last.twist.twist.linear.x == pytest.approx(0.2, abs=0.05)
    assert 0.0 < last.pose.covariance[0] < 1e-3
    assert 0.0 < last.twist.covariance[35] < 1e-2


def test_fusion_says_at_once_that_the_camera_is_lost(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    start = b.now()
    feed_fusion(b, start, 1.0)
    feed_fusion(b, start + 1.0, 1.0, camera=False)
    b.until(lambda: b.said(b"\x02", "camera lost"))
    seen, last = (b.heard["odometry/filtered"][k].pose.covariance[0] for k in (-100, -1))
    assert last > 2.0 * seen  # it grows while nobody looks
    assert b.heard["odometry/filtered"][-1].twist.covariance[0] < 1.0


def test_fusion_goes_on_with_the_camera_when_the_imu_is_lost(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    start = b.now()
    feed_fusion(b, start, 1.0)
    feed_fusion(b, start + 1.0, 0.5, imu=False)
    b.until(lambda: b.heard["odometry/filtered"][-1].twist.covariance[35] == LOST_VARIANCE)
    b.until(lambda: b.said(b"\x02", "IMU lost"))
    assert b.heard["odometry/filtered"][-1].pose.covariance[0] < 1.0


def test_fusion_judges_by_silence_not_by_the_difference_of_the_clocks(bench):
    b = bench(FusionNode, use_sim_time=True)

    def clock(time):
        b.say("/clock", Clock(clock=to_stamp(time)))
        b.until(lambda: b.node._now() > time - 1e-6)

    for k in range(200):
        clock(1000.0 + 0.01 * k)
        feed_fusion(b, 940.0 + 0.01 * k, 0.01)
    b.until(lambda: b.said(b"\x00", "estimating"))
    statuses = [s.message for array in b.heard["/diagnostics"] for s in array.status]
    assert "lost" not in " ".join(statuses)
    assert len(statuses) <= 4  # 1 Hz, and one for the change
    for k in range(20):
        clock(1002.0 + 0.1 * k)
    b.until(lambda: b.said(b"\x02", "camera and IMU lost"))  # nothing comes any more


def test_fusion_vouches_for_nothing_silent_when_its_clock_is_set_back(bench):
    node, clock = bench(FusionNode).node, [100.0]
    node._now = lambda: clock[0]
    for k in range(60):
        clock[0] = 100.0 + k / 30.0
        pose = PoseWithCovarianceStamped()
        pose.header.stamp = to_stamp(clock[0])
        node._on_pose(pose)
    clock[0] = 10.0
    assert not node._estimate().camera_lost  # it has just been set back
    clock[0] = 11.0
    assert node._estimate().camera_lost


def test_fusion_is_not_stopped_by_one_pose_from_the_future(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    start = b.now()
    feed_fusion(b, start, 1.0)
    pose = PoseWithCovarianceStamped()
    pose.header.stamp = to_stamp(start + 6.0)
    b.say("camera/pose", pose)
    feed_fusion(b, start + 1.0, 0.5)
    b.until(lambda: seconds(b.heard["odometry/filtered"][-1].header.stamp) > start + 1.4)
    assert all(m.twist.covariance[35] < 1.0 for m in b.heard["odometry/filtered"])
    stamps = [seconds(m.header.stamp) for m in b.heard["odometry/filtered"]]
    assert max(stamps) < start + 2.0
    assert np.all(np.diff(stamps) > 0.0)
    assert b.node._fusion.counts["pose_from_future"] == 1


def test_fusion_refuses_poses_of_another_frame_and_names_it(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    start = b.now()
    feed_fusion(b, start, 1.0)
    feed_fusion(b, start + 1.0, 1.0, frame="camera_optical")
    b.until(lambda: b.said(b"\x02", "camera_optical"))
    assert b.node._fusion.counts["pose_wrong_frame"] > 10


@pytest.mark.parametrize("place", [0, 7, 35])
def test_fusion_refuses_poses_of_which_a_part_is_not_measured(bench, place):
    b = bench(FusionNode)
    feed_fusion(b, b.now(), 0.5, unmeasured=place)
    b.until(lambda: b.said(b"\x02", "not measured"))
    assert b.node._fusion.counts["pose_not_measured"] > 10
    assert b.node._fusion.counts["pose"] == b.node._fusion.counts["started"] == 0


@pytest.mark.parametrize(
    ("spoil", "said", "count"),
    [
        (
            lambda m: m.pose.covariance.__setitem__(slice(1, 2), [1.0]),
            "not symmetric",
            "no_covariance",
        ),
        (lambda m: setattr(m.pose.pose.orientation, "w", 0.0), "no length", "not_finite"),
        (lambda m: setattr(m.pose.pose.position, "x", 1e300), "1000 m", "implausible"),
    ],
)
def test_fusion_survives_poses_that_are_none_and_says_why(bench, spoil, said, count):
    b = bench(FusionNode)
    for k in range(20):
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = to_stamp(b.now() + 0.01 * k), "pool"
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[[0, 7, 35]] = 1e-5
        spoil(message)
        b.say("camera/pose", message)
    b.until(lambda: b.said(b"\x02", said))
    b.until(lambda: b.node._fusion.counts[f"pose_{count}"] > 10)
    assert b.node._fusion.counts["pose"] == 0


def test_fusion_uses_nothing_that_a_message_calls_not_measured(bench):
    node = bench(FusionNode).node
    message = Imu()
    message.header.stamp = to_stamp(5.0)
    message.angular_velocity.z, message.linear_acceleration.x = 3.0, 2.0
    message.angular_velocity_covariance[0] = -1.0
    message.linear_acceleration_covariance[0] = -1.0
    message.orientation_covariance[0] = -1.0
    assert inertial_values(message) == (None,) * 5
    node._on_imu(message)
    assert node._fusion.counts["imu"] == 1


@pytest.mark.parametrize("variance", [-1e-3, 1e155, 1e308, math.inf, math.nan])
def test_a_yaw_of_which_the_variance_is_none_is_not_used(bench, variance):
    node = bench(FusionNode).node
    for k in range(3):
        message = Imu()
        message.header.stamp = to_stamp(5.0 + 0.01 * k)
        message.orientation.w, message.angular_velocity.z = 1.0, 0.5
        message.orientation_covariance[8] = variance if k == 0 else 1e-4
        values = inertial_values(message)
        assert values[3:] == ((None, None) if k == 0 else (0.0, pytest.approx(0.01)))
        node._on_imu(message)
    assert node._fusion.counts["imu"] == 3
    assert math.isfinite(node._fusion._imu.yaw[-1])


def test_a_yaw_of_unknown_variance_has_the_parameter_s():
    message = Imu()
    message.orientation.w = 1.0
    assert inertial_values(message)[3:] == (0.0, None)


def test_fusion_says_once_what_a_sample_says_that_no_fish_can_do(bench):
    b = bench(FusionNode)
    said = []
    b.node._log_once = lambda problem, remedy: said.append((problem, remedy))
    message = Imu()
    message.angular_velocity.z = 1e300
    message.header.stamp = to_stamp(5.0)
    b.node._on_imu(message)
    assert "1e+300 rad/s" in said[0][0]
    assert "expected at most 12 rad/s and 20 m/s^2" in said[0][0]
    assert b.node._fusion.counts["imu"] == 0


def test_fusion_survives_values_that_are_no_numbers(bench):
    b = bench(FusionNode)
    b.listen("odometry/filtered", Odometry)
    feed_fusion(b, b.now(), 0.5)
    bad = Imu()
    bad.angular_velocity.z = math.nan
    bad.header.stamp = to_stamp(b.now() + 10.0)
    b.say("imu/data", bad)
    bad.angular_velocity.z = 3e38  # a number, of a flipped bit
    b.say("imu/data", bad)
    pose = PoseWithCovarianceStamped()  # a quaternion of zeros
    pose.header.stamp = to_stamp(b.now())
    pose.pose.pose.orientation.w = 0.0
    b.say("camera/pose", pose)
    b.spin(0.2)
    assert all(math.isfinite(m.pose.pose.position.x) for m in b.heard["odometry/filtered"])
    b.until(lambda: b.values().get("imu_implausible") == b.values().get("imu_not_finite") == "1")


def test_planner_publishes_path_target_twist_error_and_speed(bench):
    b = bench(PlannerNode, path="straight", path_args="{length: 3.0}", speed=0.15)
    b.listen("control/target", PoseStamped)
    b.listen("control/twist", TwistStamped)
    b.listen("tracking/error", Vector3Stamped)
    b.listen("reference/path", Path, LATCHED)
    b.listen("reference/speed", Float64, LATCHED)
    t = b.now()
    b.say("odometry/filtered", odometry(t, x=-1.4, y=0.05, u=0.1))
    b.until(lambda: all(b.heard[k] for k in b.heard if k != "/diagnostics"))
    target, twist, error = (
        b.heard[k][0] for k in ("control/target", "control/twist", "tracking/error")
    )
    assert target.header.frame_id == "pool"
    assert seconds(target.header.stamp) == pytest.approx(t, abs=1e-6)
    assert math.dist(
        (target.pose.position.x, target.pose.position.y), (-1.4, 0.05)
    ) == pytest.approx(0.4, abs=1e-3)
    assert yaw_of(target.pose.orientation) == pytest.approx(-math.asin(0.05 / 0.4), abs=2e-3)
    assert (twist.header.frame_id, twist.twist.linear.x, twist.twist.angular.z) == (
        "base_link",
        0.15,
        0.0,
    )
    assert error.vector.x == pytest.approx(0.05, abs=1e-6)
    assert error.vector.y == pytest.approx(-math.asin(0.05 / 0.4), abs=2e-3)
    assert error.vector.z == pytest.approx(0.05)
    path = b.heard["reference/path"][0]
    assert path.header.frame_id == "pool"
    assert path.poses[0].pose.position.x == pytest.approx(-1.5)
    assert path.poses[-1].pose.position.x == pytest.approx(1.5)
    assert b.heard["reference/speed"][0].data == 0.15


def hear_odometry(b, message):
    """Say odometry to the planner, until it has been heard."""
    before = b.node._heard
    b.say("odometry/filtered", message)
    b.until(lambda: b.node._heard != before)


def test_planner_plans_at_half_the_rate_of_the_odometry(bench):
    b = bench(PlannerNode, path="I")
    b.listen("control/target", PoseStamped)
    t = b.now()
    for k in range(100):
        hear_odometry(b, odometry(t + 0.01 * k, y=-0.8, yaw=1.57))
        b.until(lambda k=k: len(b.heard["control/target"]) >= (k + 1) // 2)
    b.spin(0.2)
    assert len(b.heard["control/target"]) == 50


def test_planner_does_not_follow_an_estimate_that_fusion_has_lost(bench, tmp_path):
    b = bench(PlannerNode, path="I", start="nearest")  # from y = -0.85 m to 0.85 m
    node, t = b.node, b.now()
    said = []
    node._target.publish = said.append
    node._on_odometry(odometry(t, y=0.6, yaw=1.57, variance=LOST_VARIANCE))
    assert node._plan is None
    assert not said
    for k in range(10):
        node._on_odometry(odometry(t + 0.1 + 0.02 * k, y=-0.5, yaw=1.57))
    node._progress.settle()
    progress, count, kept = (
        node._planner.tracker.progress,
        len(said),
        (tmp_path / "progress.json").read_text(),
    )
    assert progress == pytest.approx(0.35, abs=0.01)
    assert count == 10
    for k in range(400):  # drifts past the end
        node._on_odometry(
            odometry(t + 0.3 + 0.01 * k, y=-0.5 + 0.005 * k, yaw=1.57, variance=LOST_VARIANCE)
        )
    assert (node._planner.tracker.progress, len(said), node._planner.finished) == (
        progress,
        count,
        False,
    )
    node._progress.settle()
    assert (tmp_path / "progress.json").read_text() == kept
    lost = odometry(t + 4.3, y=1.5, yaw=1.57, variance=LOST_VARIANCE)
    words = "camera lost: fusion does not vouch for the pose; nothing is planned"
    b.until(lambda: node._on_odometry(lost) or b.said(b"\x01", words))
    found = odometry(t + 4.4, y=-0.4, yaw=1.57)
    node._on_odometry(found)
    assert node._planner.tracker.progress == pytest.approx(0.45, abs=0.01)
    assert len(said) == count + 1
    b.until(lambda: node._on_odometry(found) or b.said(b"\x00", "following letter I"))


def test_planner_needs_no_imu_to_know_how_far_it_is(bench):
    node = bench(PlannerNode, path="I").node
    node._on_odometry(odometry(10.0, y=-0.5, yaw=1.57, twist_variance=LOST_VARIANCE))
    assert node._plan is not None


def test_planner_that_was_killed_resumes_where_it_was(bench, tmp_path):
    first = bench(PlannerNode, path="I")
    first.listen("tracking/error", Vector3Stamped)
    t = first.now()
    for k in range(40):
        hear_odometry(first, odometry(t + 0.02 * k, y=-0.85 + 0.02 * k, yaw=1.57))
    first.until(lambda: len(first.heard["tracking/error"]) >= 40)
    first.node._progress.settle()
    left_behind = (tmp_path / "progress.json").read_text()
    second = bench(PlannerNode, path="I", state_file=str(tmp_path / "second.json"))
    (tmp_path / "second.json").write_text(left_behind)
    second.say("odometry/filtered", odometry(t + 1.5, y=0.05, yaw=1.57))
    second.until(lambda: second.node._plan is not None)
    assert second.node._plan.at.progress == pytest.approx(0.9, abs=0.01)


def test_each_fish_on_a_domain_keeps_its_own_progress(graph):
    files = [planner.default_state_file(name) for name in ("/fish", "/red/fish", "/red_fish")]
    assert len(set(files)) == 3
    assert all("/" not in file.removeprefix(tempfile.gettempdir() + "/") for file in files)


def test_planner_follows_a_path_from_a_topic_and_refuses_one_through_the_wall(bench):
    b = bench(PlannerNode, path="topic")
    b.listen("control/target", PoseStamped)

    b.say("reference/path", path_message(3.0), LATCHED)
    b.until(lambda: b.said(b"\x02", "path refused: path 'reference/path' reaches"))
    hear_odometry(b, odometry(b.now(), x=-0.9))
    b.spin(0.3)
    assert not b.heard["control/target"]
    b.say("reference/path", path_message(1.0), LATCHED)
    b.until(lambda: b.node._planner is not None)
    hear_odometry(b, odometry(b.now(), x=-0.9))
    b.until(lambda: b.heard["control/target"])
    assert b.heard["control/target"][0].pose.position.x == pytest.approx(-0.5, abs=1e-3)


@pytest.mark.parametrize("qos", [LATCHED, 10], ids=["transient local", "volatile"])
def test_a_path_is_heard_once_from_publishers_of_either_durability(bench, qos):
    b = bench(PlannerNode, path="topic")
    taken = b.node._progress  # a planner per path taken
    b.say("reference/path", path_message(1.0), qos)
    b.until(lambda: b.node._planner is not None)
    planner = b.node._planner
    b.spin(0.3)
    assert b.node._planner is planner
    assert taken.problem == ""


def swim_until(b, x, condition):
    """Say odometry at x, ten times a second, until the node shows what is awaited; a late one may be too old for it."""
    for _ in range(100):
        b.say("odometry/filtered", odometry(b.now(), x=x))
        b.spin(0.1)
        if condition():
            return
    pytest.fail(f"not within 100 odometries; heard { {k: len(v) for k, v in b.heard.items()} }")


def test_path_and_speed_can_be_set_while_it_swims(bench):
    b = bench(PlannerNode, path="straight", path_args="{length: 3.0}", speed=0.15)
    b.listen("control/twist", TwistStamped)
    b.listen("reference/path", Path, LATCHED)
    swim_until(b, -1.4, lambda: b.heard["control/twist"])
    assert b.node.set_parameters([Parameter("speed", value=0.3)])[0].successful
    swim_until(b, -1.3, lambda: b.heard["control/twist"][-1].twist.linear.x == 0.3)
    assert b.heard["control/twist"][-1].twist.linear.x == 0.3
    changes = [
        Parameter("path", value="circle"),
        Parameter("path_args", value="{radius: 0.5}"),
    ]
    assert b.node.set_parameters_atomically(changes).successful
    b.until(lambda: len(b.heard["reference/path"]) > 1)
    xs = [pose.pose.position.x for pose in b.heard["reference/path"][-1].poses]
    assert max(xs) - min(xs) == pytest.approx(1.0, abs=0.01)
    turn = pytest.approx(0.3 / 0.5, abs=0.01)  # rad/s
    swim_until(b, 0.5, lambda: b.heard["control/twist"][-1].twist.angular.z == turn)
    assert b.heard["control/twist"][-1].twist.angular.z == turn


def call(b, service):
    """The answer of one of the planner's services."""
    client = b.other.create_client(Trigger, service)
    b.until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    b.until(future.done)
    return future.result()


def test_following_a_path_is_started_watched_and_canceled(bench):
    b = bench(PlannerNode, path="straight", path_args="{length: 3.0}", speed=0.15)
    b.listen("path/status", DiagnosticStatus, LATCHED)
    b.listen("control/twist", TwistStamped)

    def state():
        return b.heard["path/status"][-1].message if b.heard["path/status"] else None

    def comes(wanted, x, y=0.0):  # the estimate is said until it is heard
        b.until(lambda: b.say("odometry/filtered", odometry(b.now(), x, y)) or state() == wanted)

    comes("executing", -1.4, 0.05)
    feedback = {pair.key: float(pair.value) for pair in b.heard["path/status"][-1].values}
    assert feedback["length_m"] == pytest.approx(3.0)
    assert feedback["progress_m"] == pytest.approx(0.1, abs=0.01)
    assert feedback["cross_track_m"] == pytest.approx(0.05)
    assert call(b, "path/cancel").success
    comes("canceled", -1.3)
    b.until(lambda: b.heard["control/twist"][-1].twist.linear.x == 0.0)
    again = call(b, "path/cancel")
    assert not again.success
    assert again.message == "no path is being followed"
    assert call(b, "path/start").success
    comes("executing", -1.4)


def test_there_is_nothing_to_start_before_a_path_came(bench):
    answer = call(bench(PlannerNode, path="topic"), "path/start")
    assert (answer.success, answer.message) == (
        False,
        "there is no path yet: publish reference/path first",
    )


def path_message(half_length=1.0, frame="pool", pose_frame=""):
    message = Path()
    message.header.frame_id = frame
    for x in (-half_length, half_length):
        pose = PoseStamped()
        pose.pose.position.x, pose.header.frame_id = x, pose_frame
        message.poses.append(pose)
    return message


@pytest.mark.parametrize(
    ("frame", "pose_frame"), [("pool", ""), ("", ""), ("", "pool"), ("pool", "pool")]
)
def test_planner_takes_a_path_in_the_pool_or_in_no_frame(bench, frame, pose_frame):
    node = bench(PlannerNode, path="topic").node
    node._on_path(path_message(1.0, frame, pose_frame))
    assert node._planner is not None
    assert not node._problem


@pytest.mark.parametrize(
    ("frame", "pose_frame"), [("base_link", ""), ("pool", "base_link"), ("", "base_link")]
)
def test_planner_refuses_a_path_in_another_frame_and_follows_the_one_before(
    bench, frame, pose_frame
):
    b = bench(PlannerNode, path="topic")
    b.node._on_path(path_message(1.0))
    before = b.node._planner
    b.node._on_path(path_message(0.5, frame, pose_frame))
    assert b.node._planner is before
    b.until(
        lambda: b.said(b"\x02", "path refused: frame_id is 'base_link', expected 'pool' or none")
    )


def swim(node, start, begin, end):
    """Odometry along the x axis at 0.2 m/s; returns the time after it."""
    for k in range(round((end - begin) / 0.004)):
        node._on_odometry(odometry(start + 0.02 * k, x=begin + 0.004 * k))
        node._progress.settle()
    return start + (end - begin) / 0.2


def test_a_path_sent_again_after_its_end_is_swum_again_and_in_mid_swim_is_harmless(bench):
    node = bench(PlannerNode, path="topic").node
    node._on_path(path_message())
    time = swim(node, 100.0, -1.0, 0.0)
    node._on_path(path_message())  # in mid-swim
    time = swim(node, time, 0.0, 0.04)
    assert node._planner.tracker.progress == pytest.approx(1.04, abs=0.02)
    time = swim(node, time, 0.04, 1.02)
    assert node._planner.finished
    node._on_path(path_message())
    time = swim(node, time, 0.9, 1.0)  # where it was left, far from the beginning
    assert not node._planner.finished
    assert node._planner.tracker.progress < 0.3
    time = swim(node, time, -1.0, -0.5)  # carried to the beginning
    assert node._planner.tracker.progress == pytest.approx(0.5, abs=0.02)


def test_a_planner_that_is_killed_after_the_end_does_not_begin_again_by_itself(bench):
    first, again = bench(PlannerNode, path="topic").node, bench(PlannerNode, path="topic").node
    first._on_path(path_message())
    time = swim(first, 100.0, -1.0, 1.02)
    again._on_path(path_message())  # latched: its publisher lives
    swim(again, time, 1.0, 1.1)
    assert first._planner.finished
    assert again._planner.finished


def test_planner_says_that_there_is_no_odometry_any_more(bench):
    b = bench(PlannerNode, path="I")
    b.until(lambda: b.said(b"\x00", "waiting for odometry"))
    b.say("odometry/filtered", odometry(b.now(), y=-0.85, yaw=1.57))
    b.until(
        lambda: b.said(b"\x01", "no odometry for ") and b.said(b"\x01", " s; nothing is planned")
    )
    assert b.node._silence() > 0.5
    there = odometry(b.now(), y=-0.85, yaw=1.57)
    b.until(lambda: b.say("odometry/filtered", there) or b.said(b"\x00", "following letter I"))
    assert b.node._silence() < 0.5


def test_planner_says_that_odometry_is_not_plausible(bench):
    b = bench(PlannerNode, path="I")
    b.node._on_odometry(odometry(b.now(), y=-0.85, yaw=1.57))
    bad, words = odometry(b.now(), y=math.nan), "rad/s; nothing is planned"
    b.until(lambda: b.node._on_odometry(bad) or b.said(b"\x01", words))
    assert b.node._bad_odometry > 0
    assert b.node._loss.startswith("odometry is not plausible")


@pytest.mark.parametrize(
    ("elapsed", "silence"),
    [
        ((0.3, 0.3), 0.3),
        ((0.8, 0.7), 0.7),
        ((60.0, 0.1), 0.1),  # a clock set ahead, or simulated time that runs fast
        ((0.01, 3.0), 0.01),  # simulated time that waits for a busy computer
        ((-50.0, 0.2), -50.0),  # a clock set back
    ],
)
def test_a_silence_is_one_on_both_clocks(bench, elapsed, silence):
    node = bench(PlannerNode, path="I").node
    assert node._silence() == 0.0
    node._clocks = lambda: (1000.0, 7.0)
    node._on_odometry(odometry(1000.0))
    node._clocks = lambda: (1000.0 + elapsed[0], 7.0 + elapsed[1])
    assert node._silence() == pytest.approx(silence)


@pytest.mark.parametrize("crash", [True, False])
def test_a_planner_that_crashes_leaves_its_progress_and_one_that_ends_does_not(
    tmp_path, monkeypatch, crash
):
    file = tmp_path / "progress.json"

    class Spin:
        def init(self, arguments):
            rclpy.init(args=arguments)

        def __call__(self, nodes):
            swim(nodes[0], 100.0, -1.0, 0.0)
            assert file.exists()
            raise ValueError("a mistake in a callback") if crash else KeyboardInterrupt

    monkeypatch.setattr(planner, "ByEvents", Spin)
    arguments = ["path:=straight", 'path_args:="{length: 2.0}"', f"state_file:={file}"]
    monkeypatch.setattr(
        sys, "argv", ["node", "--ros-args", *(w for a in arguments for w in ("-p", a))]
    )
    if crash:
        with pytest.raises(ValueError, match="a mistake"):
            planner.main()
    else:
        assert planner.main() == 0
    assert file.exists() == crash


@pytest.mark.parametrize("x", [1e13, 1e308])
def test_planner_survives_a_path_to_a_far_point(bench, x):
    node, message = bench(PlannerNode, path="topic").node, Path()
    message.poses = [PoseStamped(), PoseStamped(), PoseStamped()]
    message.poses[1].pose.position.x, message.poses[2].pose.position.x = x, -x
    node._on_path(message)
    assert "m long, expected at most 200 m" in node._problem
    assert node._planner is None


def drive(b, duration, **changes):
    """Feed the controller for a while of simulated time, in lockstep, with a fish that should turn left."""
    for _ in range(round(duration / PERIOD)):
        b.tick(lambda time: _feed(b, time, changes))


def drive_until(b, condition, duration=10.0):
    """Feed the controller until a condition holds; its word on a busy computer may come after some more simulated time."""
    for _ in range(round(duration / 0.2)):
        drive(b, 0.2)
        if condition():
            return
    pytest.fail(f"not within {duration} s of simulated time")


def _feed(b, time, changes):
    without, time = changes.get("without", ()), time - changes.get("age", AGE)
    stamp = seconds(to_stamp(time))
    if "odometry" not in without:
        b.say("odometry/filtered", odometry(time, **changes.get("odometry", {})))
        b.until(lambda: b.node._odometry_time == stamp)
    if "target" not in without:
        twist = TwistStamped()
        twist.twist.linear.x = changes.get("speed", 0.2)
        twist.twist.angular.z = changes.get("yaw_rate", 0.1)
        error, target = Vector3Stamped(), PoseStamped()
        target.header.stamp = to_stamp(time)
        target.pose.orientation = to_quaternion(0.3)
        twist.header = error.header = target.header
        if "twist" not in without:
            b.say("control/twist", twist)
        if "error" not in without:
            b.say("tracking/error", error)
        b.say("control/target", target)
        b.until(lambda: b.node._target_time == stamp)


def controller_bench(bench, **parameters):
    b = bench(ControllerNode, **{"use_sim_time": True, **parameters})
    b.listen("joint_command", JointState)
    b.listen("control/gains", Float64MultiArray)
    return b


def commands(b, count):
    newest = b.heard["joint_command"][-count:]
    return np.array([(m.position[0], m.velocity[0], m.position[1]) for m in newest])


def test_controller_is_at_rest_until_somebody_says_that_the_robot_is_armed(bench):
    b = controller_bench(bench, arming_required=True)
    drive(b, 1.5)
    b.until(lambda: b.said(b"\x01", "disarmed: no arming/state yet"))
    np.testing.assert_allclose(commands(b, 20)[:, 1:], 0.0)
    arm(b)
    drive(b, 1.5)
    assert np.abs(commands(b, 60)[:, 1]).max() > 20.0


def test_controller_streams_named_commands_and_labelled_gains(bench):
    b = controller_bench(bench)
    drive(b, 1.5)
    message = b.heard["joint_command"][-1]
    assert list(message.name) == ["rotor", "rudder"]
    moved = commands(b, 60)
    assert np.abs(moved[:, 1]).max() > 20.0
    assert moved[-1, 2] > 0.0
    gains = b.heard["control/gains"][-1]
    assert [d.label for d in gains.layout.dim] == ["steering,speed", "Kp,Ki,Kd"]
    assert len(gains.data) == 6
    heard = len(b.heard["joint_command"])
    for _ in range(22):
        b.tick()
    b.until(lambda: len(b.heard["joint_command"]) > heard + 20)  # also without odometry


def hear_plan(node, time):
    header = Header(stamp=to_stamp(time))
    node._on_target(PoseStamped(header=header))
    node._on_twist(TwistStamped(header=header, twist=Twist(linear=Vector3(x=0.2))))
    node._on_error(Vector3Stamped(header=header))


@pytest.mark.parametrize(("simulated", "count"), [(False, 5), (True, 0)])
def test_a_command_follows_each_new_odometry_and_in_simulated_time_the_clock(
    bench, simulated, count
):
    b = controller_bench(bench, use_sim_time=simulated, odometry_timeout=0.5)
    b.executor.remove_node(b.node)  # no timer runs
    start = b.now()
    b.node.get_clock = lambda: SimpleNamespace(now=lambda: Time(nanoseconds=round(1e9 * start)))
    for k in range(5):
        b.node._on_odometry(odometry(start + 0.01 * k))
        b.node._on_odometry(b.node._odometry)  # the same once more
    b.until(lambda: len(b.heard["joint_command"]) >= count)
    b.spin(0.1)
    assert len(b.heard["joint_command"]) == count


@pytest.mark.parametrize("period", [0.005, 0.01, 0.015, 0.02])
def test_decisions_come_fifty_times_a_second_however_often_commands_come(bench, period):
    b = controller_bench(bench)
    b.executor.remove_node(b.node)
    count = round(2.0 / period)
    for k in range(1, count + 1):
        now = 10.0 + k * period
        b.node.get_clock().set_ros_time_override(Time.from_msg(to_stamp(now)))
        hear_plan(b.node, now)
        b.node._on_odometry(odometry(now))
        b.node._tick()
        b.until(lambda k=k: len(b.heard["joint_command"]) == k)
    b.spin(0.1)
    assert len(b.heard["control/gains"]) == pytest.approx(100, abs=10)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"without": ["odometry"]}, "odometry is stale"),
        ({"without": ["target"]}, "target is stale"),
        ({"without": ["twist"]}, "control/twist is stale"),
        ({"without": ["error"]}, "tracking/error is stale"),
        ({"speed": math.nan}, "control/twist is stale"),
        ({"speed": 1e9}, "control/twist is stale"),
        ({"yaw_rate": math.inf}, "control/twist is stale"),
        ({"odometry": {"x": math.nan}}, "odometry is not plausible"),
        ({"odometry": {"variance": LOST_VARIANCE}}, "camera lost"),
        ({"odometry": {"twist_variance": LOST_VARIANCE}}, "IMU lost"),
    ],
)
def test_controller_stops_on_every_fault_and_swims_again_when_it_has_passed(bench, fault, said):
    b = controller_bench(bench, resume_delay=0.1)
    b.listen("arming/pause", String)
    drive(b, 0.6)
    assert np.abs(commands(b, 40)[:, 1]).max() > 10.0
    drive(b, 1.0, **fault)
    b.until(lambda: b.said(b"\x02", said))
    np.testing.assert_allclose(commands(b, 5)[:, 1:], 0.0, atol=1e-6)
    assert b.heard["arming/pause"][-1].data.startswith(f"controller: {said}")
    drive_until(b, lambda: b.said(b"\x00", "swimming"))
    assert np.abs(commands(b, 40)[:, 1]).max() > 10.0
    b.until(lambda: b.heard["arming/pause"][-1].data == "")


@pytest.mark.parametrize("lost", ["variance", "twist_variance"])
def test_controller_learns_nothing_of_the_water_from_an_estimate_that_fusion_has_lost(bench, lost):
    node = bench(ControllerNode).node
    for k in range(20):
        node._on_odometry(odometry(10.0 + 0.01 * k, u=0.0))
    learned = node._controller._observer.state
    for k in range(20, 400):  # of a drifting accelerometer
        node._on_odometry(odometry(10.0 + 0.01 * k, u=0.01 * k, **{lost: LOST_VARIANCE}))
    assert node._controller._observer.state == learned
    assert node._controller._motion.surge == 0.0
    assert node._odometry_time == pytest.approx(
        13.99
    )  # the watchdog sees that it comes, and why not to swim
    signs = node._signs(14.0)
    assert not node._watchdog.check(14.0, signs)
    assert "lost" in node._watchdog.reason


@pytest.mark.parametrize("sway", [100.0, 1e200, -1e308])
def test_one_estimate_that_no_fish_can_have_leaves_nothing_in_the_controller(bench, sway):
    hears, misses = bench(ControllerNode).node, bench(ControllerNode).node
    for k in range(20):
        message = odometry(10.0 + 0.01 * k)
        if k == 10:
            message.twist.twist.linear.y = sway
        else:
            misses._on_odometry(message)
        hears._on_odometry(message)
    assert hears._controller._observer.state == misses._controller._observer.state
    assert hears._controller._motion.sway == 0.0


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "error"),
    [(1e-120, 0.1, 0.0), (1e308, 0.1, 0.0), (0.2, 1e308, 0.0), (0.2, 0.1, 1e308)],
)
def test_a_wish_that_no_robot_can_follow_is_forgotten_with_the_next(bench, speed, yaw_rate, error):
    node = bench(ControllerNode).node
    hear_plan(node, 10.0)
    for k in range(400):
        if k == 100:
            node._on_twist(
                TwistStamped(twist=Twist(linear=Vector3(x=speed), angular=Vector3(z=yaw_rate)))
            )
            node._on_error(Vector3Stamped(vector=Vector3(x=error)))
        if k == 110:
            hear_plan(node, 11.1)
        node._on_odometry(odometry(10.0 + 0.01 * k))
        node._target_time = node._twist_time = node._error_time = 10.0 + 0.01 * k
        node._step(Time.from_msg(to_stamp(10.0 + 0.01 * k)))
        assert all(map(math.isfinite, node._gains_message.data))
    assert abs(node._controller._actuators.alpha) < 0.2
    assert node._controller._setpoint.throttle > 0.0


def test_controller_glides_when_no_speed_is_wanted(bench):
    b = controller_bench(bench)
    drive(b, 0.5)
    drive(b, 0.8, speed=0.0, yaw_rate=0.5)
    moved = commands(b, 10)
    np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[:, 2], 0.8)


def test_controller_reports_its_latency(bench):
    b = controller_bench(bench)
    for _ in range(15):
        drive(b, 0.09)
        drive(b, 0.01, age=0.009)
    b.until(lambda: "latency_p50_ms" in b.values())
    assert float(b.values()["latency_p50_ms"]) == pytest.approx(1e3 * AGE, abs=0.1)
    assert float(b.values()["latency_p99_ms"]) == pytest.approx(9.0, abs=0.1)


def test_controller_commands_rest_by_its_own_timer_while_no_odometry_comes(bench):
    b = controller_bench(bench, use_sim_time=False)
    b.until(lambda: len(b.heard["joint_command"]) >= 5)
    np.testing.assert_allclose(commands(b, 5)[:, 1:], 0.0)


PROGRAM = [{"t": 0, "amplitude": 8, "frequency": 2, "rudder": 0.3}]


def exciter_bench(bench, tmp_path, **parameters):
    file = tmp_path / "program.json"
    file.write_text(json.dumps(PROGRAM))
    b = bench(ExciterNode, program_file=str(file), rest=0.1, **{"use_sim_time": True, **parameters})
    b.listen("joint_command", JointState)
    return b


def show(b, duration, **odometry_changes):
    """Feed the estimate alone for a while of simulated time, in lockstep."""

    def feed(time):
        b.say("odometry/filtered", odometry(time, **odometry_changes))
        b.until(
            lambda: b.node._odometry is not None and b.node._odometry.header.stamp == to_stamp(time)
        )

    for _ in range(round(duration / PERIOD)):
        b.tick(feed)


def wait(b, duration):
    """Simulated time in which nobody says anything."""
    for _ in range(round(duration / PERIOD)):
        b.tick()


def test_exciter_waits_for_the_estimate_swims_its_part_and_ends_at_rest(bench, tmp_path):
    b = exciter_bench(bench, tmp_path, begin=2.0, end=2.8)
    wait(b, 0.2)
    b.until(lambda: b.said(b"\x01", "waiting for odometry") and len(b.heard["joint_command"]) >= 10)
    np.testing.assert_allclose(commands(b, 10)[:, 1:], 0.0)
    show(b, 2.5)
    b.until(lambda: b.said(b"\x00", "ended at 2.8 s, as programmed"))
    moved = commands(b, 1000)
    assert np.abs(moved[:, 1]).max() > 60.0
    assert moved[:, 2].max() == pytest.approx(0.3)
    np.testing.assert_allclose(moved[-5:, 1:], 0.0)


@pytest.mark.parametrize(
    ("fault", "level", "said"),
    [
        ({"x": 2.0}, b"\x01", "before a wall, at (2.00, 0.00) m"),
        ({"x": math.nan}, b"\x02", "odometry is not plausible"),
        ({"variance": LOST_VARIANCE}, b"\x02", "does not vouch"),
        (None, b"\x02", "odometry is stale"),
    ],
)
def test_exciter_stops_for_good_where_the_guard_finds_a_reason(bench, tmp_path, fault, level, said):
    b = exciter_bench(bench, tmp_path)
    show(b, 0.8)
    assert np.abs(commands(b, 60)[:, 1]).max() > 40.0
    wait(b, 1.2) if fault is None else show(b, 1.2, **fault)
    show(b, 0.5)
    b.until(lambda: b.said(level, said) and b.said(level, "stopped at "))
    np.testing.assert_allclose(commands(b, 5)[:, 1], 0.0)


def arm(b):
    """As the owner of the arming state says it."""
    armed = DiagnosticArray(status=[DiagnosticStatus(level=DiagnosticStatus.OK, message="armed")])
    b.say("arming/state", armed)
    b.other.create_timer(0.05, lambda: b.say("arming/state", armed))
    b.until(lambda: b.node._arming.armed)


def test_exciter_waits_for_somebody_who_says_that_the_robot_is_armed(bench, tmp_path):
    b = exciter_bench(bench, tmp_path, arming_required=True)
    show(b, 0.5)
    b.until(lambda: b.said(b"\x01", "waiting for the robot to be armed: no arming/state yet"))
    np.testing.assert_allclose(commands(b, 50)[:, 1:], 0.0)
    arm(b)
    show(b, 0.8)
    assert np.abs(commands(b, 60)[:, 1]).max() > 40.0


def test_exciter_without_its_guard_swims_without_looking(bench, tmp_path):
    b = exciter_bench(bench, tmp_path, guard=False)
    wait(b, 1.0)
    assert np.abs(commands(b, 50)[:, 1]).max() > 40.0


@pytest.mark.parametrize(
    ("kind", "output", "topic"),
    [
        (FusionNode, Odometry, "odometry/filtered"),
        (ControllerNode, JointState, "joint_command"),
        (ExciterNode, JointState, "joint_command"),
        (PlannerNode, PoseStamped, "control/target"),
    ],
)
def test_a_second_node_of_the_same_kind_is_warned_of_on_diagnostics_and_console(
    bench, tmp_path, monkeypatch, capfd, kind, output, topic
):
    monkeypatch.setattr(rivals, "PATIENCE_S", 0.0)
    exciter = kind is ExciterNode
    b = exciter_bench(bench, tmp_path, use_sim_time=False) if exciter else bench(kind)
    b.other.create_publisher(output, topic, 10)
    b.until(lambda: b.said(DiagnosticStatus.WARN, f"another publisher of /fish/{topic}"))
    said = [line for line in capfd.readouterr().err.splitlines() if "another publisher" in line]
    assert len(said) == 1
    assert "[WARN]" in said[0]


@pytest.mark.parametrize(
    ("main", "parameter", "said"),
    [
        (planner.main, "path:='7'", "unknown letter '7'; known: A B"),
        (planner.main, "path:=circel", "unknown path 'circel'; known: circle"),
        (planner.main, "speed:=0.7", "speed is 0.7 m/s, expected 0.05 to 0.5 m/s"),
        (planner.main, "speed:=fast", "speed is 'fast', expected float"),
        (planner.main, "path_args:='{height: 2.2}'", "this must stay within |y| <= 0.965"),
        (planner.main, "path_args:='{'", "expected YAML"),
        (
            planner.main,
            "sped:=0.1",
            "unknown parameter sped (did you mean speed?); known: body_frame, ",
        ),
        (controller.main, "lokahead:=0.4", "unknown parameter lokahead (did you mean lookahead?)"),
        (fusion.main, "foo:=1", "unknown parameter foo; known: "),
        (
            exciter.main,
            "use_sim_tme:=true",
            "unknown parameter use_sim_tme; known: arming_required, begin, ",
        ),
        (
            controller.main,
            "weights_file:=nowhere.safetensors",
            "nowhere.safetensors: cannot be read",
        ),
        (controller.main, f"weights_file:={__file__}", "not a safetensors file"),
        (
            controller.main,
            "lookahead:=0.5",
            "does not fit: lookahead is 0.4, this controller runs at 0.5",
        ),
        (fusion.main, "gate:=-1.0", "gate is -1.0"),
        (exciter.main, "begin:=1.0", "program_file is empty, expected a file with a program"),
        (exciter.main, "program_file:=nowhere.json", "No such file or directory: 'nowhere.json'"),
        (exciter.main, f"program_file:={__file__}", "is neither JSON nor YAML"),
    ],
)
def test_what_cannot_start_says_why_in_one_line(main, parameter, said, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["node", "--ros-args", "-p", parameter])
    assert main() == 1
    end = capsys.readouterr().err
    assert said in end
    assert end.count("\n") == 1


@pytest.mark.parametrize("key", ["Y", "N", "O"])
def test_letters_that_yaml_takes_for_something_else(graph, key, tmp_path):
    rclpy.init()
    arguments = ["--ros-args", "-p", f"path:={key}", "-p", f"state_file:={tmp_path / 'p.json'}"]
    node = PlannerNode(cli_args=arguments)
    name = node._planner.path.name
    node.destroy_node()
    rclpy.try_shutdown()
    assert name == f"letter {key}"


def test_parameters_of_ros_itself_are_no_mistakes(graph):
    rclpy.init()
    names = (
        "use_sim_time",
        "start_type_description_service",
        "qos_overrides./parameter_events.publisher.depth",
    )
    values = [f"{name}:={value}" for name, value in zip(names, ("true", "false", "3"), strict=True)]
    node = FusionNode(
        cli_args=["--ros-args", *(word for value in values for word in ("-p", value))]
    )
    follows_clock = node.get_parameter("use_sim_time").value
    node.destroy_node()
    rclpy.try_shutdown()
    assert follows_clock


def test_a_program_that_cannot_start_exits_with_1(tmp_path):
    code = "import sys; from fish_control.nodes.planner import main; sys.exit(main())"
    ended = subprocess.run(
        [sys.executable, "-c", code, "--ros-args", "-p", "path:=circel"],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith("planner: unknown path")
    assert ended.stderr.count("\n") == 1
