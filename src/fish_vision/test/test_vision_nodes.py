# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker node in this process, and pictures of a camera's topic for the commands.

Messages in and out, and bad input of every kind; pictures that are accepted, and silence.
"""

import os
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from math import atan2, exp, pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
sys.path.insert(0, str(Path(__file__).parent))

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from pool_picture import CONFIG, discs_of_fish, draw, lens_fields, with_tag
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from fish_node import rivals
from fish_vision.config import config_from_file
from fish_vision.nodes import picture_source
from fish_vision.nodes.picture_source import collect
from fish_vision.nodes.tracker import TrackerNode
from fish_vision.picture import PictureError, to_jpeg
from fish_vision.tags import tag_picture

pytestmark = pytest.mark.ros
DOMAIN = 142
PICTURES_DOMAIN = "175"  # above those that tests of other packages draw
POSE = (0.5, 0.2, 1.0)
PICTURE = draw(discs_of_fish(*POSE, (0.3, -0.2, 0.1)))
MOUNT = {"camera_position": list(CONFIG.camera_position), "camera_tilt": list(CONFIG.camera_tilt)}


def another(count: int) -> bytes:
    """The picture once more, in other bytes, as a camera's noise makes them."""
    return to_jpeg(PICTURE, 95 + count % 2)


class Bench:
    """A tracker node and a node that plays camera and listener, spun by hand."""

    def __init__(self, parameters: dict[str, object]) -> None:
        arguments = ["--ros-args"] + [a for k, v in parameters.items() for a in ("-p", f"{k}:={v}")]
        rclpy.init(args=arguments, domain_id=DOMAIN)
        self.tracker, self.peer = TrackerNode(), Node("peer", namespace="fish")
        self.info = self.peer.create_publisher(CameraInfo, "camera/camera_info", 10)
        self.jpeg = self.peer.create_publisher(CompressedImage, "camera/image_raw/compressed", 10)
        self.raw = self.peer.create_publisher(Image, "camera/image_raw", 10)
        self.got: dict[str, list] = {"pose": [], "tail": [], "debug": []}
        self.got |= {"diagnostics": [], "lockstep": []}
        for name, kind, topic in (
            ("pose", PoseWithCovarianceStamped, "camera/pose"),
            ("tail", JointState, "camera/tail"),
            ("debug", CompressedImage, "camera/debug/compressed"),
            ("diagnostics", DiagnosticArray, "/diagnostics"),
            ("lockstep", Header, "lockstep"),
        ):
            self.peer.create_subscription(kind, topic, self.got[name].append, 10)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.tracker)
        self.executor.add_node(self.peer)
        publisher = self.raw if "use_raw" in parameters else self.jpeg
        assert self.spin_until(
            lambda: publisher.get_subscription_count() and self.info.get_subscription_count()
        )
        self.frame = 0

    def spin_until(self, condition, limit: float = 10.0) -> bool:
        clock = self.peer.get_clock()
        start = clock.now()
        while not condition() and (clock.now() - start).nanoseconds < limit * 1e9:
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def _stamped(self, msg: CameraInfo | CompressedImage | Image):
        self.frame += 1
        msg.header.frame_id, msg.header.stamp.sec = "overhead_optical", 1000
        msg.header.stamp.nanosec = self.frame * 33_000_000
        return msg

    def send_info(self, **changes: object) -> None:
        width, height, model, k, d = lens_fields()
        fields = {
            "width": width,
            "height": height,
            "distortion_model": model,
            "k": k,
            "d": d,
        } | changes
        self.info.publish(self._stamped(CameraInfo(**fields)))
        self.spin_until(
            lambda: self.tracker._info is not None and list(self.tracker._info[3]) == fields["k"]
        )

    def send_jpeg(self, data: bytes) -> None:
        self.jpeg.publish(self._stamped(CompressedImage(format="jpeg", data=data)))

    def send_raw(self, picture: np.ndarray, encoding: str) -> None:
        height, width = picture.shape[:2]
        step = picture[0].nbytes
        msg = Image(
            height=height, width=width, encoding=encoding, step=step, data=picture.tobytes()
        )
        self.raw.publish(self._stamped(msg))

    def says(self, text: str) -> bool:
        """Whether a diagnostic message with the text comes."""
        return self.spin_until(
            lambda: any(text in d.status[0].message for d in self.got["diagnostics"])
        )

    def close(self) -> None:
        self.executor.shutdown()
        self.tracker.destroy_node()
        self.peer.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(MOUNT | getattr(request, "param", {}))
    yield made
    made.close()


@pytest.mark.parametrize("own_first", [False, True])
def test_check_image_reads_a_params_file_as_the_node_does(tmp_path: Path, own_first: bool) -> None:
    parts = ["/**:\n  ros__parameters: {pixel_std: 0.03, max_speed: 1.0}\n"]
    parts.insert(
        0 if own_first else 1,
        "/fish/tracker:\n  ros__parameters: {pixel_std: 0.07, tail_links: 2}\n",
    )
    path = tmp_path / "params.yaml"
    path.write_text("".join(parts))
    rclpy.init(args=["--ros-args", "--params-file", str(path)], domain_id=DOMAIN)
    node = TrackerNode()
    try:
        assert config_from_file(path) == node._config
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def check_pose(msg: PoseWithCovarianceStamped) -> None:
    p, q = msg.pose.pose.position, msg.pose.pose.orientation
    assert (p.x, p.y, p.z) == pytest.approx((*POSE[:2], 0.0), abs=1e-3)
    assert 2 * atan2(q.z, q.w) == pytest.approx(POSE[2], abs=0.01)
    covariance = np.array(msg.pose.covariance).reshape(6, 6)
    assert 0 < covariance[0, 0] < 1e-5
    assert 0 < covariance[5, 5] < 1e-3
    np.testing.assert_allclose(covariance, covariance.T)
    assert (np.diag(covariance)[2:5] > 1e3).all()  # z, roll, pitch are not seen,
    unseen = covariance[2:5] - np.eye(6)[2:5] * covariance[2:5]
    assert not unseen.any()  # and go with nothing that is


@pytest.mark.parametrize("bench", [{"debug_image": True}], indirect=True)
def test_pose_and_tail_come_with_the_stamp_of_the_image(bench: Bench) -> None:
    bench.send_info()
    bench.send_jpeg(to_jpeg(PICTURE, 95))
    assert bench.spin_until(lambda: all(bench.got[k] for k in ("pose", "tail", "debug")))
    pose, tail = bench.got["pose"][0], bench.got["tail"][0]
    check_pose(pose)
    assert pose.header.frame_id == tail.header.frame_id == "pool"
    assert pose.header.stamp.sec == 1000
    assert pose.header.stamp.nanosec == bench.frame * 33_000_000
    assert tail.header.stamp == pose.header.stamp
    assert tail.name == ["tail_1", "tail_2", "tail_3"]
    assert list(tail.position) == pytest.approx([0.3, -0.2, 0.1], abs=0.1)
    assert bench.says("fish seen in all 1 images")


def test_an_image_without_the_fish_is_said_to_who_waits_for_its_pose(bench: Bench) -> None:
    bench.send_info()
    bench.send_jpeg(to_jpeg(draw([])))
    assert bench.spin_until(lambda: bench.got["lockstep"])
    said = bench.got["lockstep"][-1]
    assert (said.frame_id, said.stamp.nanosec) == ("tracker", bench.frame * 33_000_000)
    bench.send_jpeg(to_jpeg(PICTURE))
    assert bench.spin_until(lambda: bench.got["pose"])
    assert len(bench.got["lockstep"]) == 1


def test_a_second_tracker_of_the_same_topic_is_warned_of(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rivals, "PATIENCE_S", 0.0)
    bench.peer.create_publisher(PoseWithCovarianceStamped, "camera/pose", 10)
    assert bench.says("another publisher of /fish/camera/pose: stop one of the two")
    assert bench.got["diagnostics"][-1].status[0].level == DiagnosticStatus.WARN


@pytest.mark.parametrize("bench", [{"use_raw": True}], indirect=True)
def test_raw_images_work_and_wrong_encodings_are_said(bench: Bench) -> None:
    bench.send_info()
    bench.send_raw(PICTURE[..., ::-1], "mono16")
    assert bench.says("encoding 'mono16'")
    bench.send_raw(PICTURE[:, 1:, :2], "yuv422_yuy2")
    assert bench.says("width 1279: expected an even one")
    bench.send_raw(PICTURE[..., ::-1], "rgb8")
    assert bench.spin_until(lambda: bool(bench.got["pose"]))
    check_pose(bench.got["pose"][0])


@pytest.mark.parametrize(
    ("bench", "topic", "reliability"),
    [
        ({"use_raw": True}, "camera/image_raw", ReliabilityPolicy.RELIABLE),
        ({}, "camera/image_raw/compressed", ReliabilityPolicy.BEST_EFFORT),
    ],
    indirect=["bench"],
)
def test_raw_images_which_are_many_packets_each_come_reliably(
    bench: Bench, topic: str, reliability: ReliabilityPolicy
) -> None:
    """Best effort had lost four of five: one lost packet is a lost image."""
    [tracker] = bench.peer.get_subscriptions_info_by_topic(f"/fish/{topic}")
    assert tracker.qos_profile.reliability == reliability
    [own] = [s for s in bench.tracker.subscriptions if s.topic_name == f"/fish/{topic}"]
    assert own.qos_profile.depth == 1  # a late image is worse than a lost one


@pytest.mark.parametrize(
    "bench", [{"marker_kind": "tags", "tag_size": 0.08, "head_tag": 5}], indirect=True
)
def test_a_fish_with_tags_has_the_same_topics(bench: Bench) -> None:
    bench.send_info()
    bench.send_jpeg(to_jpeg(with_tag(draw([]), tag_picture("4X4_50", 5), *POSE, 0.08), 95))
    assert bench.spin_until(lambda: bool(bench.got["pose"]))
    check_pose(bench.got["pose"][0])
    assert bench.says("fish seen in all 1 images")
    assert "hue_shifts" not in [v.key for v in bench.got["diagnostics"][-1].status[0].values]


@pytest.mark.parametrize("bench", [{"lowpass_hz": 2.0}], indirect=True)
def test_a_low_pass_stamps_its_poses_earlier_than_their_images(bench: Bench) -> None:
    bench.send_info()
    for count in (1, 2):
        bench.send_jpeg(another(count))
        assert bench.spin_until(lambda n=count: len(bench.got["pose"]) == n)
    stamps = [p.header.stamp.nanosec for p in bench.got["pose"]]
    assert stamps[0] == (bench.frame - 1) * 33_000_000
    weight = 1 - exp(-2 * pi * 2.0 * 0.033)
    assert stamps[1] == pytest.approx(stamps[0] + weight * 33_000_000, abs=2000)
    check_pose(bench.got["pose"][1])


def test_a_frozen_image_gives_no_pose_and_the_fish_is_found_where_it_is_afterwards(
    bench: Bench,
) -> None:
    """Followed in the frozen image, the own fish would be another one where the camera shows it again."""
    bench.send_info()
    bench.send_jpeg(another(0))
    assert bench.spin_until(lambda: len(bench.got["pose"]) == 1)
    for count in range(1, 32):  # 1 s
        bench.send_jpeg(another(0))
        assert bench.spin_until(lambda n=count: bench.tracker._statistics.images == n + 1)
    assert bench.says("the same image as before: the camera is frozen")
    assert len(bench.got["pose"]) == 1
    moved = (POSE[0] - 0.4, *POSE[1:])
    bench.send_jpeg(to_jpeg(draw(discs_of_fish(*moved, (0.3, -0.2, 0.1))), 95))
    assert bench.spin_until(lambda: len(bench.got["pose"]) == 2)
    assert bench.got["pose"][1].pose.pose.position.x == pytest.approx(moved[0], abs=5e-3)


def test_bad_images_are_said_and_the_next_good_one_is_tracked(bench: Bench) -> None:
    assert bench.says("no camera/camera_info yet")
    bench.send_jpeg(to_jpeg(PICTURE))
    assert bench.spin_until(lambda: bench.tracker._statistics.refused["no calibration"] == 1)
    bench.send_info()
    good = to_jpeg(PICTURE, 95)
    for bad, text in (
        (good[:5000], "cut off"),
        (b"nonsense", "no JPEG"),
        (to_jpeg(PICTURE[:360]), "1280 x 360"),
    ):
        bench.send_jpeg(bad)
        assert bench.says(text)
    bench.send_jpeg(to_jpeg(draw([])))
    assert bench.says("no front marker")
    assert not bench.got["pose"]
    bench.send_jpeg(good)
    assert bench.spin_until(lambda: bool(bench.got["pose"]))
    check_pose(bench.got["pose"][0])
    assert bench.tracker._statistics.refused == {"no calibration": 1, "bad image": 3}


def test_bad_calibrations_are_said_and_a_good_one_mends_it(
    bench: Bench, capfd: pytest.CaptureFixture[str]
) -> None:
    for changes, text in (
        ({"k": [0.0] * 9}, "not calibrated"),
        (
            {
                "distortion_model": "omnidirectional",
                "d": [0.1] * 4,
                "k": [901.0, *lens_fields()[3][1:]],
            },
            "omnidirectional",
        ),
        ({"k": [1e-300, 0.0, 640.0, 0.0, 1e-300, 360.0, 0.0, 0.0, 1.0]}, "not calibrated"),
        ({"k": [900.0, 0.0, 5000.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0]}, "camera_position"),
    ):
        bench.send_info(**changes)
        assert bench.says(text)
        assert bench.got["diagnostics"][-1].status[0].level == DiagnosticStatus.ERROR
    said = [line for line in capfd.readouterr().err.splitlines() if "not calibrated" in line]
    assert len(said) == 1
    assert "[ERROR]" in said[0]
    bench.send_info()
    bench.send_jpeg(to_jpeg(PICTURE, 95))
    assert bench.spin_until(lambda: bool(bench.got["pose"]))


@pytest.mark.parametrize("scale", [1.0, 1.053])
def test_a_wrong_focal_length_is_named_with_the_one_that_fits(scale: float) -> None:
    """camera_info has a focal length 5 % short: refused and named, or corrected by focal_scale."""
    bench = Bench(MOUNT | {"focal_scale": scale})
    try:
        bench.send_info(k=[855.0, 0.0, 640.0, 0.0, 855.0, 360.0, 0.0, 0.0, 1.0])
        if scale != 1.0:
            bench.send_jpeg(another(0))
            assert bench.spin_until(lambda: bool(bench.got["pose"]))
            check_pose(bench.got["pose"][0])
            return
        for count in range(1, 61):
            bench.send_jpeg(another(count))
            assert bench.spin_until(lambda n=count: bench.tracker._statistics.images == n)
        assert bench.says("no poses: what is on the head seems +5.")
        message = bench.got["diagnostics"][-1].status[0].message
        assert float(re.search(r"focal_scale ([\d.]+)", message)[1]) == pytest.approx(
            1.053, abs=5e-3
        )
        assert float(re.search(r"corrects it to (\d+) pixels", message)[1]) == pytest.approx(
            900, abs=5
        )
        assert re.search(r"hangs 2\.8\d m above the markers and not 3\.00 m", message)
        assert not bench.got["pose"]
    finally:
        bench.close()


def test_bad_parameters_are_refused_with_their_name() -> None:
    for name, value in (
        ("area_min", 5.0),
        ("front_colour", [1, 2, 3]),
        ("camera_tilt", "flat"),
        ("area_mni", 1.0),
    ):
        with pytest.raises(ValueError, match=name):
            Bench({name: value})
        rclpy.try_shutdown()


class Camera:
    """Publishes grey pictures of 32 x 24 pixels, each 10 levels lighter, until it is closed."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("camera", context=self._context)
        self._jpeg = self._node.create_publisher(CompressedImage, "/image/compressed", 1)
        self._raw = self._node.create_publisher(Image, "/image", 1)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def _publish(self) -> None:
        level = 0
        while not self._end.wait(0.05):
            level = (level + 10) % 250
            picture = np.full((24, 32, 3), level, np.uint8)
            self._jpeg.publish(CompressedImage(format="jpeg", data=to_jpeg(picture)))
            self._raw.publish(
                Image(height=24, width=32, encoding="bgr8", step=96, data=picture.tobytes())
            )

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> Iterator[Camera]:
    monkeypatch.setenv("ROS_DOMAIN_ID", PICTURES_DOMAIN)
    made = Camera()
    yield made
    made.close()


@pytest.mark.parametrize("topic", ["/image/compressed", "/image"])
def test_only_accepted_pictures_are_collected(camera: Camera, topic: str) -> None:
    pictures = collect(topic, lambda p: int(p[0, 0, 0]) % 20 > 5, count=3, silence=60.0)
    assert len(pictures) == 3
    assert all(p.shape == (24, 32, 3) and int(p[0, 0, 0]) % 20 > 5 for p in pictures)


def test_a_clock_that_is_set_ahead_is_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    hours = (Time(seconds=3600 * k) for k in range(10))
    node = SimpleNamespace(get_clock=lambda: SimpleNamespace(now=lambda: next(hours)), refused="")

    @contextmanager
    def spinning(_, take):
        turns = iter([lambda: None, lambda: None, lambda: take("picture")])
        yield node, SimpleNamespace(spin_once=lambda timeout_sec: next(turns)())

    monkeypatch.setattr(picture_source, "_spinning", spinning)
    assert collect("/image", lambda _: True, count=1, silence=600.0) == ["picture"]


def test_silence_is_an_error_that_names_the_topic(camera: Camera) -> None:
    with pytest.raises(PictureError, match=r"/nobody: no picture for 0\.5 s .*is the camera"):
        collect("/nobody", lambda _: True, count=1, silence=0.5)
