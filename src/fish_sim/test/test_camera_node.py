# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera node in this process: stamps, delay, loss, messages, bad input."""

import os
from collections.abc import Iterator
from math import cos, sin
from time import monotonic

import cv2
import numpy as np
import pytest

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from fish_sim.camera import FishPose, FishShape
from fish_sim.camera.fish import markers
from fish_sim.nodes.camera import CameraNode

pytestmark = pytest.mark.ros
DOMAIN = 141
QUIET = {"drop_rate": 0.0, "noise_std": 0.0, "glare": 0.0, "exposure_s": 0.0}


class Bench:
    """A camera node and a node that plays simulator and listener, spun by hand."""

    def __init__(self, parameters: dict[str, object]) -> None:
        arguments = ["--ros-args"] + [a for k, v in parameters.items() for a in ("-p", f"{k}:={v}")]
        rclpy.init(args=arguments, domain_id=DOMAIN)
        self.camera, self.peer = CameraNode(), Node("peer", namespace="fish")
        self.got: dict[str, list] = {
            "info": [],
            "jpeg": [],
            "raw": [],
            "diagnostics": [],
            "arrival": [],
        }
        self.odometry = self.peer.create_publisher(Odometry, "sim/odometry", 1000)
        for name, kind, topic in (
            ("info", CameraInfo, "camera/camera_info"),
            ("jpeg", CompressedImage, "camera/image_raw/compressed"),
            ("raw", Image, "camera/image_raw"),
            ("diagnostics", DiagnosticArray, "/diagnostics"),
        ):
            self.peer.create_subscription(kind, topic, lambda msg, n=name: self._keep(n, msg), 10)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.camera)
        self.executor.add_node(self.peer)

    def _keep(self, name: str, msg: object) -> None:
        if name == "diagnostics" and msg.status[0].name != "fish/camera":
            return  # /diagnostics has no namespace: a node of another test may speak in this domain
        self.got[name].append(msg)
        if name == "jpeg":
            self.got["arrival"].append(self.now())

    def now(self) -> float:
        return self.peer.get_clock().now().nanoseconds * 1e-9

    def set_clock(self, time: float) -> None:
        """Say on /clock until the camera follows it, and until it hears the simulation."""
        clock = self.peer.create_publisher(Clock, "/clock", 10)
        message = Clock(clock=Time(nanoseconds=round(time * 1e9)).to_msg())

        def follows() -> bool:
            clock.publish(message)
            camera = self.camera.get_clock().now().nanoseconds * 1e-9
            return camera == time and self.odometry.get_subscription_count() > 0

        assert self.spin_until(follows, limit=120.0)

    def send(self, pose: FishPose, stamp: float) -> None:
        msg = Odometry()
        msg.header.stamp = Time(nanoseconds=round(stamp * 1e9)).to_msg()
        msg.pose.pose.position.x, msg.pose.pose.position.y = pose.x, pose.y
        msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = (
            sin(pose.heading / 2),
            cos(pose.heading / 2),
        )
        self.odometry.publish(msg)

    def spin_until(self, condition, limit: float = 10.0, pose: FishPose | None = None) -> bool:
        """Spin, with odometry every 10 ms if a pose is given, until the condition holds or time is up."""
        end, sent = monotonic() + limit, self.now()
        while not condition() and monotonic() < end:
            if pose is not None and self.now() - sent >= 0.01:
                sent = self.now()
                self.send(pose, sent)
            self.executor.spin_once(timeout_sec=0.005)
        return condition()

    def close(self) -> None:
        self.executor.shutdown()
        self.camera.destroy_node()
        self.peer.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(QUIET | getattr(request, "param", {}))
    yield made
    made.close()


def seconds(msg: CameraInfo | CompressedImage | Image) -> float:
    return msg.header.stamp.sec + msg.header.stamp.nanosec * 1e-9


@pytest.mark.parametrize("bench", [{"use_sim_time": True, "latency_s": 0.0}], indirect=True)
def test_a_camera_that_was_busy_misses_nothing_of_the_fish(bench: Bench) -> None:
    """Half a second of the simulation waits for it; a sample that is lost is a heading that is guessed."""
    bench.set_clock(10.0)
    for k in range(50):
        bench.send(FishPose(0.01 * k, 0.0, 0.0), 9.95 + 0.01 * k)
    assert bench.spin_until(lambda: len(bench.got["info"]) >= 13, limit=120.0)
    gaps = np.diff([seconds(info) for info in bench.got["info"]])
    np.testing.assert_allclose(gaps, 1 / 30, atol=1e-6)


@pytest.mark.parametrize("bench", [{"use_sim_time": True, "latency_s": 0.0}], indirect=True)
def test_a_picture_that_would_come_too_late_is_not_drawn(bench: Bench) -> None:
    bench.set_clock(10.0)
    for stamp in (9.5, 9.6, 9.7, 10.0):
        bench.send(FishPose(0.0, 0.0, 0.0), stamp)
    assert bench.spin_until(lambda: len(bench.got["info"]) >= 1, limit=120.0)
    assert seconds(bench.got["info"][0]) == pytest.approx(10.0, abs=1 / 30)


@pytest.mark.parametrize("bench", [{"latency_s": 0.08, "publish_raw": True}], indirect=True)
def test_frames_show_the_fish_and_come_late_with_the_exposure_as_stamp(bench: Bench) -> None:
    pose = FishPose(0.5, 0.2, 1.0)
    assert bench.spin_until(
        lambda: min(len(bench.got[k]) for k in ("info", "jpeg", "raw")) >= 3, pose=pose
    )
    info, jpeg, raw = (bench.got[k][2] for k in ("info", "jpeg", "raw"))
    assert info.header == jpeg.header == raw.header
    assert info.header.frame_id == "overhead_optical"
    assert seconds(jpeg) * 30.0 == pytest.approx(round(seconds(jpeg) * 30.0), abs=1e-3)
    assert bench.got["arrival"][2] - seconds(jpeg) >= 0.08
    picture = cv2.imdecode(np.frombuffer(jpeg.data, np.uint8), cv2.IMREAD_COLOR)
    sent = np.frombuffer(raw.data, np.uint8).reshape(raw.height, raw.width, 3)
    assert raw.encoding == "bgr8"
    assert cv2.PSNR(picture, sent) > 30.0
    K, D = np.array(info.k).reshape(3, 3), np.array(info.d)
    assert (info.width, info.height, info.distortion_model) == (1280, 720, "plumb_bob")
    (front, _, colour), *_ = markers(pose, FishShape())
    camera = bench.camera._renderer.camera
    rotation = cv2.Rodrigues(camera.R)[0]
    u, v = np.round(
        cv2.projectPoints(np.array([[*front, 0.0]]), rotation, camera.t, K, D)[0].ravel()
    ).astype(int)
    assert np.abs(sent[v, u].astype(int) - colour).max() < 40


@pytest.mark.parametrize("bench", [{"drop_rate": 1.0}], indirect=True)
def test_lost_frames_are_counted_not_sent(bench: Bench) -> None:
    assert bench.spin_until(lambda: bench.camera._dropped >= 5, pose=FishPose(0.0, 0.0, 0.0))
    assert not bench.got["jpeg"]


def test_diagnostics_say_what_is_missing_and_nan_is_ignored(
    bench: Bench, capfd: pytest.CaptureFixture[str]
) -> None:
    bench.send(FishPose(float("nan"), 0.0, 0.0), bench.now())
    assert bench.spin_until(lambda: bool(bench.got["diagnostics"]))
    status = bench.got["diagnostics"][0].status[0]
    assert status.name == "fish/camera"
    assert status.level == DiagnosticStatus.WARN
    assert "sim/odometry" in status.message
    assert not bench.got["jpeg"]
    assert status.message in capfd.readouterr().err


def test_stamps_of_another_clock_are_noticed_but_frames_flow(bench: Bench) -> None:
    for k in range(30):
        bench.send(FishPose(0.0, 0.0, 0.0), 5.0 + 0.01 * k)
        bench.executor.spin_once(timeout_sec=0.05)
    assert bench.spin_until(lambda: len(bench.got["jpeg"]) >= 3)
    assert bench.spin_until(
        lambda: any("use_sim_time" in d.status[0].message for d in bench.got["diagnostics"])
    )


@pytest.mark.parametrize("bench", [{"exposure_s": 0.004, "latency_s": 0.0}], indirect=True)
@pytest.mark.parametrize("begin", [0, -1], ids=["at 0", "before 0"])
def test_a_time_that_begins_at_0_is_outlived(bench: Bench, begin: int) -> None:
    """The first exposure would have begun before time did; its stamp had ended the node."""
    for k in range(100 * (1 - begin)):
        message = Odometry()
        message.header.stamp.sec, centiseconds = divmod(100 * begin + k, 100)
        message.header.stamp.nanosec = 10_000_000 * centiseconds
        bench.camera._on_odometry(message)
    assert bench.camera._sent == pytest.approx(30, abs=1)  # of the second from 0 on


def test_bad_parameters_are_refused_with_their_name() -> None:
    with pytest.raises(ValueError, match="rate_hz"):
        Bench({"rate_hz": -3.0})
    rclpy.try_shutdown()
    with pytest.raises(ValueError, match="distortion"):
        Bench({"distortion": "none"})
    rclpy.try_shutdown()
    with pytest.raises(ValueError, match=r"unknown parameter rate_h \(did you mean rate_hz"):
        Bench({"rate_h": 3.0})
    rclpy.try_shutdown()
