# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recorder and replayer as real processes on real topics."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import repeat
from types import SimpleNamespace

import numpy as np
import pytest

from fish_bag import sample_recordings as samples

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from fish_bag import RecordingError, read_trial
from fish_bag.bag import read_bag
from fish_bag.recover import recover
from fish_node.domain import choose_domain

pytestmark = pytest.mark.ros
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOSSY = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
ALL = QoSProfile(depth=1000)


class Peer:
    """A node of this process in a domain of its own, and processes started beside it."""

    def __init__(self) -> None:
        self.domain = choose_domain()
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = Node("peer", namespace="fish", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[subprocess.Popen] = []
        self.said: dict[str, str] = {}  # last on /diagnostics
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 10)

    def _hear(self, array: DiagnosticArray) -> None:
        (status,) = array.status
        self.said = {"message": status.message, **{v.key: v.value for v in status.values}}

    def start(self, executable: str, /, **parameters: object) -> subprocess.Popen:
        given = [a for k, v in parameters.items() for a in ("-p", f"{k}:={v}")]
        process = subprocess.Popen(
            [sys.executable, "-m", f"fish_bag.nodes.{executable}", "--ros-args", *given],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"ROS_DOMAIN_ID": str(self.domain)},
        )
        self.processes.append(process)
        return process

    def spin_until(self, condition: Callable[[], object], limit: float = 60.0) -> bool:
        end = time.monotonic() + limit
        while not condition() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.communicate()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def peer() -> Iterator[Peer]:
    bench = Peer()
    yield bench
    bench.close()


def publish_all(peer: Peer, count: int) -> tuple[list[bytes], list[int]]:
    """Topics of every quality of service, once the recorder listens; the IMU's raw bytes and times [ns].

    The recorder's middleware has all of them when this returns: it gets them in order, and has the last command.
    """
    latched = peer.node.create_publisher(Float64, "reference/speed", LATCHED)
    latched.publish(Float64(data=0.25))  # before anybody listens
    imu = peer.node.create_publisher(Imu, "imu/data", LOSSY)
    command = peer.node.create_publisher(JointState, "joint_command", 10)
    assert peer.spin_until(
        lambda: imu.get_subscription_count() and command.get_subscription_count()
    )
    raws, times = [], []
    store = samples.typestore()
    for i in range(count):
        message = samples.build.imu(samples.ns(0.01 * i), (0, 0, i), (0, 0, 9.81), (0, 0, 0, 1))
        raws.append(bytes(store.serialize_cdr(message, "sensor_msgs/msg/Imu")))
        times.append(time.time_ns())
        imu.publish(raws[-1])
        command.publish(
            JointState(name=["rotor", "rudder"], position=[float(i), 0.0], velocity=[1.0, 0.0])
        )
        peer.spin_until(lambda: False, limit=0.01)
    command.wait_for_all_acked(Duration(seconds=60))
    return raws, times


def test_recorder_keeps_every_byte(peer, tmp_path):
    recorder = peer.start("recorder", output=tmp_path, name="run", robot="trout")
    raws, times_ns = publish_all(peer, 100)
    end_ns = time.time_ns()
    recorder.send_signal(signal.SIGTERM)
    out, _ = recorder.communicate(timeout=15)
    assert recorder.returncode == 0, out
    assert "messages of" in out
    bag = read_bag(tmp_path / "run", lambda *_: True)
    topics = {raw.topic: raw for raw in bag.topics}
    assert topics["/fish/imu/data"].raws == raws
    assert len(topics["/fish/joint_command"].raws) == 100
    assert len(topics["/fish/reference/speed"].raws) == 1
    assert "/diagnostics" in topics
    assert bag.metadata == {"robot": "trout"}
    arrived_ns = topics["/fish/imu/data"].arrival_ns
    assert np.all(arrived_ns > times_ns)
    assert np.all(arrived_ns < end_ns)  # and not when the recorder looks


def test_killed_recorder_loses_at_most_a_second(peer, tmp_path):
    topics = "[joint_command, imu/data, reference/speed]"
    recorder = peer.start("recorder", output=tmp_path, name="run", topics=topics)
    raws, times_ns = publish_all(peer, 200)
    assert peer.spin_until(lambda: peer.said.get("messages") == "401")
    recorder.kill()
    recorder.wait()
    with pytest.raises(RecordingError, match="robofish recover"):
        read_trial(tmp_path / "run")
    recover(tmp_path / "run", tmp_path / "saved")
    saved = read_bag(tmp_path / "saved", lambda *_: True)
    imu = next(raw for raw in saved.topics if raw.topic == "/fish/imu/data")
    assert (times_ns[-1] - imu.arrival_ns[-1]) * 1e-9 < 1.0
    assert imu.raws == raws[: len(imu.raws)]


@pytest.mark.parametrize("stranger_is_first", [True, False])
def test_a_second_type_on_a_topic_hides_no_message_of_the_robot(peer, tmp_path, stranger_is_first):
    """A foreign node announces another type on the IMU's topic, before the IMU or after it."""
    recorder = peer.start("recorder", output=tmp_path, name="run")
    other = Context()
    rclpy.init(context=other, domain_id=peer.domain)
    stranger = Node("stranger", context=other)
    early = peer.node.create_publisher(Imu, "imu/data", LOSSY)
    if stranger_is_first:
        peer.node.destroy_publisher(early)
    else:
        assert peer.spin_until(early.get_subscription_count)
    wrong = stranger.create_publisher(Float64, "/fish/imu/data", 10)
    wrong.publish(Float64(data=1.0))
    if stranger_is_first:
        assert peer.spin_until(wrong.get_subscription_count)
    raws, _ = publish_all(peer, 100)
    foreign = "not recorded: /fish/imu/data (std_msgs/msg/Float64)"
    assert peer.spin_until(lambda: peer.said.get("message") == foreign)
    stranger.destroy_node()
    rclpy.try_shutdown(context=other)
    assert peer.spin_until(lambda: peer.said["message"] == "recording")
    recorder.send_signal(signal.SIGTERM)
    out, _ = recorder.communicate(timeout=30)
    assert recorder.returncode == 0, out
    topics = read_bag(tmp_path / "run", lambda *_: True).topics
    recorded = {raw.topic: raw for raw in topics if raw.type != "std_msgs/msg/Float64"}
    assert len(recorded["/fish/joint_command"].raws) == 100
    assert recorded["/fish/imu/data"].raws == raws
    assert "/fish/imu/data (std_msgs/msg/Float64) is not recorded" in out
    reason = "the robot publishes" if stranger_is_first else "sensor_msgs/msg/Imu came first"
    assert reason in out


@pytest.mark.parametrize(
    ("node", "parameters", "text"),
    [
        ("recorder", {"output": "/proc/none"}, "recorder: "),
        ("replayer", {"recording": "/nowhere"}, "replayer: /nowhere: does not exist"),
    ],
)
def test_bad_parameters_are_one_line(peer, node, parameters, text):
    process = peer.start(node, **parameters)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 1
    assert out.startswith(text)
    assert "Traceback" not in out
    assert len(out.splitlines()) == 1


FULL_DISK = '''
import errno, sys
from fish_bag.nodes import recorder
from fish_bag.mcap_writer import RecordFile

class Full:
    """A disk with room for 60 kB and for what the reserve gives back."""
    def __init__(self, raw, reserve): self.raw, self.reserve, self.room = raw, reserve, 60_000
    def __getattr__(self, name): return getattr(self.raw, name)
    def write(self, data):
        self.room -= len(data)
        if self.room < 0 and self.reserve.exists(): raise OSError(errno.ENOSPC, "No space left on device")
        return self.raw.write(data)

start = RecordFile.__init__
def limited(self, path):
    start(self, path)
    self._raw = Full(self._raw, self._reserve)
RecordFile.__init__ = limited
sys.exit(recorder.main())
'''


def test_full_disk_is_one_line_and_a_valid_recording(peer, tmp_path):
    arguments = [
        "--ros-args",
        "-p",
        f"output:={tmp_path}",
        "-p",
        "name:=run",
        "--log-level",
        "warn",
    ]
    process = subprocess.Popen(
        [sys.executable, "-c", FULL_DISK, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(peer.domain)},
    )
    peer.processes.append(process)
    publish_all(peer, 250)
    _, errors = process.communicate(timeout=15)
    assert process.returncode == 1
    assert errors.startswith("recorder: ")
    assert "No space left on device" in errors
    assert len(errors.splitlines()) == 1
    assert len(read_trial(tmp_path / "run").imu) > 50


def test_replay_sends_the_same_bytes_at_the_same_times(peer, tmp_path):
    path = samples.robot_recording(tmp_path / "run", duration=2.0)
    got: list[tuple[int, bytes]] = []
    clock: list[int] = []
    peer.node.create_subscription(
        Imu,
        "imu/data",
        lambda raw, about: got.append((about["source_timestamp"], raw)),
        ALL,
        raw=True,
    )
    other: list[bytes] = []
    peer.node.create_subscription(JointState, "elsewhere", other.append, ALL, raw=True)
    stamp = lambda m: clock.append(m.clock.sec * 10**9 + m.clock.nanosec)  # noqa: E731
    peer.node.create_subscription(Clock, "/clock", stamp, ALL)
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "fish_bag.nodes.replayer",
            "--ros-args",
            "-p",
            f"recording:={path}",
            "-p",
            "exclude:=['camera/*']",
            "-p",
            "start_delay_s:=8.0",  # a busy computer discovers slowly
            "-r",
            "/fish/joint_command:=/fish/elsewhere",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(peer.domain)},
    )
    peer.processes.append(process)
    assert peer.spin_until(lambda: process.poll() is not None)
    peer.spin_until(lambda: False, limit=0.2)
    out = process.stdout.read()
    assert process.returncode == 0, out
    sent = {raw.topic: raw.raws for raw in read_bag(path, lambda *_: True).topics}
    assert [raw for _, raw in got] == sent["/fish/imu/data"]
    assert other == sent["/fish/joint_command"]
    latest = float(re.search(r"latest (\d+\.\d) ms after its time", out)[1]) * 1e-3
    times = np.array([ns - got[0][0] for ns, _ in got]) * 1e-9  # when they were sent
    assert np.max(np.abs(times - np.arange(200) * 0.01)) < latest + 0.5
    assert np.all(np.diff(clock) > 0)
    assert len(clock) > 20
    assert clock[-1] - clock[0] == pytest.approx(2e9, abs=1e8)


def test_pause_rate_and_loop(peer, tmp_path):
    path = samples.robot_recording(tmp_path / "run", duration=1.0)
    got: list[int] = []
    peer.node.create_subscription(
        Imu, "imu/data", lambda m: got.append(round(m.angular_velocity.z * 100)), ALL
    )
    pause = peer.node.create_client(SetBool, "replayer/pause")
    process = peer.start(
        "replayer",
        recording=path,
        paused=True,
        loop=True,
        rate=2.0,
        topics="['imu/data']",
        start_delay_s=0.0,
    )
    assert pause.wait_for_service(20.0)
    assert peer.spin_until(lambda: peer.node.count_publishers("/fish/imu/data"))
    peer.spin_until(lambda: False, limit=0.5)
    assert got == []
    started = time.monotonic()
    assert peer.spin_until(pause.call_async(SetBool.Request(data=False)).done)
    assert peer.spin_until(lambda: len(got) >= 250)
    assert time.monotonic() - started > 1.0  # 2.5 rounds of 1 s at rate 2 take 1.25 s
    assert got[:250] == [*range(100), *range(100), *range(50)]
    done = pause.call_async(SetBool.Request(data=True))
    assert peer.spin_until(done.done)
    assert done.result().message == "paused"
    peer.spin_until(lambda: False, limit=0.3)
    stopped = len(got)
    peer.spin_until(lambda: False, limit=0.5)
    assert len(got) == stopped
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 0


def test_ctrl_c_does_not_tear_what_the_recorder_is_writing(monkeypatch):
    """rclpy ends the spinning; a KeyboardInterrupt in the middle of a record would leave half of it in the file."""
    from fish_bag.nodes import recorder

    written = []

    def run(make_node: object, name: str) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        written.append(name)
        return 0

    monkeypatch.setattr(recorder, "run", run)
    before = signal.getsignal(signal.SIGINT)
    assert recorder.main() == 0
    assert written == ["recorder"]
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("says_when", [True, False])
def test_what_has_arrived_before_the_end_is_recorded(peer, tmp_path, monkeypatch, says_when):
    """A recorder on a busy computer is behind the middleware when it is told to end.

    Not every middleware says when a message arrived.
    """
    from fish_bag.nodes import recorder as module
    from fish_bag.nodes.recorder import RecorderNode

    def without_times(subscription):
        return ((data, about | {"received_timestamp": 0}) for data, about in take_all(subscription))

    take_all = module.take_all
    if not says_when:
        monkeypatch.setattr(module, "take_all", without_times)
    arguments = [f"output:={tmp_path}", "name:=a", "topics:=[numbers]"]
    words = ["node", "--ros-args", *(word for given in arguments for word in ("-p", given))]
    rclpy.init(args=words, domain_id=peer.domain)
    recorder, count = RecorderNode(), 200
    publisher = peer.node.create_publisher(Float64, "numbers", ALL)
    heard: list[float] = []
    peer.node.create_subscription(Float64, "numbers", lambda m: heard.append(m.data), ALL)
    try:
        own = SingleThreadedExecutor()
        own.add_node(recorder)
        assert peer.spin_until(
            lambda: own.spin_once(0.05) or publisher.get_subscription_count() == 2
        )
        for k in range(count):
            publisher.publish(Float64(data=float(k)))
        assert peer.spin_until(lambda: len(heard) == count)  # and the recorder has not been spun
        publisher.wait_for_all_acked(Duration(seconds=60))  # its middleware has the last, too
    finally:
        rclpy.try_shutdown()  # what a signal does
        recorder.destroy_node()
    (topic,) = read_bag(tmp_path / "a", lambda *_: True).topics
    assert len(topic.raws) == count
    assert (np.diff(topic.arrival_ns) >= 0).all()


def test_a_topic_faster_than_the_recorder_leaves_time_for_the_others(monkeypatch):
    """Where the middleware does not say when a message arrived, the queue's depth ends a look."""
    from fish_bag.nodes import recorder

    written = []
    monkeypatch.setattr(recorder, "take_all", lambda _: repeat((b"", {"received_timestamp": 0})))
    node = SimpleNamespace(
        _subscriptions_of={k: (None, SimpleNamespace(depth=5), k) for k in ("one", "two")},
        recording=SimpleNamespace(write=lambda channel, *_: written.append(channel)),
    )
    recorder.RecorderNode._store_new(node)
    assert written == ["one"] * 5 + ["two"] * 5
