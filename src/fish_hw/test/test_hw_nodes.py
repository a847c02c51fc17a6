# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nodes: topics, units, frames, stamps and refusals in one process; signals with real processes."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fakes import wait_until
from rclpy.clock import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, CompressedImage, Image, Imu, JointState
from sensor_msgs.srv import SetCameraInfo
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from fish_hw.devices.imu_sample import ImuSample
from fish_hw.devices.reconnect import Doubt, Loss
from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.emulators.vertiq import VELOCITY_MODE, VertiqEmulator
from fish_hw.nodes.camera import CameraNode
from fish_hw.nodes.device_node import run
from fish_hw.nodes.fake_robot import FakeRobotNode
from fish_hw.nodes.imu import ImuNode
from fish_hw.nodes.rotor import RotorNode
from fish_hw.nodes.rudder import RudderNode
from fish_hw.nodes.worker import Worker
from fish_hw.protocol import iquart
from fish_hw.transport.sysfs_pwm import SysfsPwm
from fish_node import arming, rivals
from fish_node.camera_file import CameraFileError, read_camera_file
from fish_node.file_head import jpeg_size

pytestmark = pytest.mark.ros
DOMAIN = 176 + os.getpid() % 50  # tests of other packages, below, run at the same time
TIMEOUT_S = 20.0


class Graph:
    """A node under test and a peer, spun together."""

    def __init__(self, node_class: Callable, parameters: dict) -> None:
        arguments = [a for k, v in parameters.items() for a in ("-p", f"{k}:={v}")]
        rclpy.init(args=["--ros-args", *arguments], domain_id=DOMAIN)
        node = None
        try:
            self.node = node = node_class()
            node.begin()
        except Exception:
            if node is not None:
                node.close()
                node.destroy_node()
            rclpy.try_shutdown()
            raise
        self.peer = rclpy.create_node("peer", namespace="fish")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.received: dict[str, list] = {}

    def listen(self, kind: type, topic: str) -> list:
        self.received[topic] = []
        self.peer.create_subscription(kind, topic, self.received[topic].append, 10)
        return self.received[topic]

    def spin(self, until: Callable[[], bool], each: Callable[[], None] = lambda: None) -> bool:
        """Spin until it is so; `each` is done a hundred times a second: more would leave the device's threads no time."""
        deadline, due = time.monotonic() + TIMEOUT_S, 0.0
        while not until() and (now := time.monotonic()) < deadline:
            if now >= due:
                each()
                due = now + 0.01
            self.executor.spin_once(timeout_sec=0.01)
        return until()

    def call(self, kind: type, name: str, request) -> object:
        client = self.peer.create_client(kind, name)
        assert client.wait_for_service(TIMEOUT_S)
        future = client.call_async(request)
        assert self.spin(future.done)
        return future.result()

    def arm(self) -> bool:
        """Whether the operator was allowed to arm."""
        return self.call(SetBool, "arm", SetBool.Request(data=True)).success

    def arming(self, publisher, rotor: float = 50.0) -> Callable[[], None]:
        """Command the rotor and ask for arming again and again, as an operator who wants to swim at any price."""
        client = self.peer.create_client(SetBool, "arm")

        def each() -> None:
            publisher.publish(command(rotor=rotor))
            self.asked = client.call_async(SetBool.Request(data=True))

        return each

    def close(self) -> None:
        self.node.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def graph():
    graphs = []

    def make(node_class: Callable, **parameters) -> Graph:
        graphs.append(Graph(node_class, parameters))
        return graphs[-1]

    yield make
    for graph in graphs:
        graph.close()


def command(rotor: float = 0.0, rudder: float = 0.0) -> JointState:
    return JointState(name=["rotor", "rudder"], position=[0.0, rudder], velocity=[rotor, 0.0])


def age_s(graph: Graph, stamp) -> float:
    now = graph.peer.get_clock().now().nanoseconds
    return (now - stamp.sec * 10**9 - stamp.nanosec) * 1e-9


def test_rotor_topics(graph, vertiq_emulator):
    g = graph(
        RotorNode,
        port=vertiq_emulator.port,
        estimate="ignored",
        rudder_timeout_s=0.0,
        reply_timeout_s=0.2,
        module_timeout_s=1.0,
    )
    states = g.listen(JointState, "joint_states")
    battery = g.listen(BatteryState, "battery_state")
    diagnostics = g.listen(DiagnosticArray, "/diagnostics")
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    assert g.spin(
        lambda: bool(states) and abs(states[-1].velocity[0] - 80.0) < 1.0,
        g.arming(publisher, 80.0),
    )
    assert list(states[-1].name) == ["rotor"]
    assert len(states[-1].position) == 1
    assert 0.0 <= age_s(g, states[-1].header.stamp) < 1.0
    assert g.spin(lambda: bool(battery) and len(diagnostics) > 1)
    assert battery[0].voltage == pytest.approx(14.8, abs=0.01)
    assert battery[0].current == pytest.approx(-0.5, abs=0.01)
    assert diagnostics[0].status[0].name == "fish/rotor"
    assert {"phase", "crc errors", "volts"} <= {v.key for v in diagnostics[-1].status[0].values}


def test_rotor_coasts_when_commands_end(graph, vertiq_emulator):
    g = graph(
        RotorNode,
        port=vertiq_emulator.port,
        estimate="ignored",
        rudder_timeout_s=0.0,
        reply_timeout_s=0.2,
        module_timeout_s=1.0,
    )
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, g.arming(publisher))
    assert g.spin(lambda: vertiq_emulator.mode == iquart.COAST)
    assert vertiq_emulator.timeouts == 0  # told to, not left to its own watchdog


@pytest.mark.parametrize(
    "bad",
    [
        JointState(),
        JointState(name=["rudder"], position=[0.0]),
        JointState(name=["rotor"]),
        JointState(name=["rotor"], velocity=[float("nan")]),
        JointState(name=["rotor"], velocity=[float("inf")]),
    ],
    ids=["empty", "other joint", "no value", "nan", "inf"],
)
def test_rotor_survives_bad_commands(graph, vertiq_emulator, bad):
    g = graph(
        RotorNode,
        port=vertiq_emulator.port,
        estimate="ignored",
        rudder_timeout_s=0.0,
        reply_timeout_s=0.2,
        module_timeout_s=1.0,
    )
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    assert g.spin(lambda: g.node._driver.rejected > 3, lambda: publisher.publish(bad))
    assert vertiq_emulator.mode == iquart.COAST
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, g.arming(publisher))


def test_rotor_moves_only_while_a_person_has_armed_it(graph, vertiq_emulator):
    g = graph(
        RotorNode,
        port=vertiq_emulator.port,
        estimate="ignored",
        rudder_timeout_s=0.0,
        stale_s=1.0,
        reply_timeout_s=0.2,
        module_timeout_s=1.0,
    )
    states = g.listen(DiagnosticArray, "arming/state")
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)

    def drive() -> None:
        publisher.publish(command(rotor=50.0))

    assert g.spin(lambda: len(states) > 20, drive)
    assert vertiq_emulator.mode == iquart.COAST
    assert states[-1].status[0].level == DiagnosticStatus.WARN
    assert states[-1].status[0].message == "not armed since the start"
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, g.arming(publisher))
    assert g.spin(lambda: bool(states) and states[-1].status[0].message == "armed", drive)
    assert g.call(SetBool, "arm", SetBool.Request(data=False)).success
    assert g.spin(lambda: vertiq_emulator.mode == iquart.COAST, drive)
    assert states[-1].status[0].message == "disarmed by the operator"
    vertiq_emulator.faults_ever = 2
    assert g.call(Trigger, "rotor/clear_faults", Trigger.Request()).success
    assert g.spin(lambda: vertiq_emulator.faults_ever == 0, drive)


@pytest.mark.parametrize(
    ("kind", "topic", "data", "reason"),
    [
        (Bool, "operator/estop", True, "emergency stop is pressed"),
        (String, "arming/disarm", "the planner is silent", "the planner is silent"),
        (String, "arming/pause", "controller: target is stale", "controller: target is stale"),
        (String, "rudder/trouble", "output lost", "rudder: output lost"),
    ],
)
def test_other_nodes_and_the_emergency_stop_disarm(
    graph, vertiq_emulator, kind, topic, data, reason
):
    g = graph(
        RotorNode,
        port=vertiq_emulator.port,
        estimate="ignored",
        rudder_timeout_s=0.0,
        stale_s=1.0,
        reply_timeout_s=0.2,
        module_timeout_s=1.0,
    )
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    other = g.peer.create_publisher(kind, topic, 10)
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, g.arming(publisher))

    def each() -> None:
        publisher.publish(command(rotor=50.0))
        other.publish(kind(data=data))

    assert g.spin(lambda: vertiq_emulator.mode == iquart.COAST, each)
    assert g.node._driver.arming.reason == reason


@pytest.mark.parametrize(
    ("node_class", "emulated"),
    [(RotorNode, {"port": "emulator"}), (RudderNode, {"backend": "emulator"})],
)
def test_no_timer_rests_while_the_computers_clock_is_set_back(graph, node_class, emulated):
    g = graph(node_class, **emulated)
    assert {timer.clock.clock_type for timer in g.node.timers} == {ClockType.STEADY_TIME}


def test_a_driver_that_waits_for_simulated_time_says_so(graph):
    g = graph(RotorNode, port="emulator", use_sim_time=True, startup_timeout_s=2.5)
    diagnostics = g.listen(DiagnosticArray, "/diagnostics")
    assert g.spin(lambda: bool(diagnostics))
    assert "no time on /clock" in diagnostics[0].status[0].message
    assert g.spin(lambda: bool(g.node.failure))
    assert "no time on /clock" in g.node.failure


def test_a_driver_goes_on_where_the_simulated_clock_is_set_back(graph):
    g = graph(RotorNode, port="emulator", use_sim_time=True, **PATIENT)
    states = g.listen(JointState, "joint_states")
    ticks = g.peer.create_publisher(Clock, "/clock", 10)
    asks = g.arming(g.peer.create_publisher(JointState, "joint_command", 10))
    now_ns = [1000 * 10**9]

    def tick() -> None:
        now_ns[0] += 10**7
        ticks.publish(Clock(clock=Time(nanoseconds=now_ns[0]).to_msg()))

    def each() -> None:
        tick()
        asks()

    assert g.spin(lambda: g.node._emulator.mode == VELOCITY_MODE, each)
    now_ns[0] = 0
    assert g.spin(lambda: bool(states) and states[-1].header.stamp.sec < 900, each)
    count = len(states)
    assert g.spin(lambda: len(states) > count + 50, each)
    assert 0.0 <= states[-1].header.stamp.sec < 900
    assert g.node._driver.arming.check(g.node.clock.now())
    assert g.spin(lambda: not g.node._driver.arming.armed, tick)  # silence counts as before
    assert g.node._driver.arming.reason == "no joint_command for 1 s"


@pytest.mark.parametrize(("said", "volts"), [(math.nan, 11.1), (math.inf, 11.1), (12.0, 12.0)])
def test_a_fake_robot_takes_a_voltage_that_was_measured(said, volts):
    robot = SimpleNamespace(rotor=SimpleNamespace(volts=11.1))
    FakeRobotNode._on_battery(SimpleNamespace(_robot=robot), BatteryState(voltage=said))
    assert robot.rotor.volts == volts


def test_a_second_commander_is_warned_of(graph, monkeypatch, capfd):
    monkeypatch.setattr(rivals, "PATIENCE_S", 0.0)
    g = graph(RotorNode, port="emulator")
    both = [g.peer.create_publisher(JointState, "joint_command", 10) for _ in range(2)]
    said = []

    def warned() -> bool:
        said.append(capfd.readouterr().err)
        return "another publisher of /fish/joint_command: stop one of the two" in "".join(said)

    assert g.spin(warned)
    assert len(both) == 2


# without estimate and rudder; a loaded computer keeps the emulated module waiting
PATIENT = {
    "estimate": "ignored",
    "rudder_timeout_s": 0.0,
    "stale_s": 1.0,
    "reply_timeout_s": 0.2,
    "module_timeout_s": 1.0,
}


def test_a_deadman_that_is_let_go_for_a_moment_disarms(graph, vertiq_emulator):
    g = graph(RotorNode, port=vertiq_emulator.port, deadman_timeout_s=5.0, **PATIENT)
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    deadman = g.peer.create_publisher(Bool, "operator/deadman", 10)
    asks = g.arming(publisher)

    def each() -> None:
        deadman.publish(Bool(data=True))
        asks()

    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, each)
    assert g.spin(g.asked.done, lambda: publisher.publish(command(rotor=50.0)))
    for held in (False, True):
        deadman.publish(Bool(data=held))
    assert g.spin(
        lambda: vertiq_emulator.mode == iquart.COAST, lambda: publisher.publish(command(rotor=50.0))
    )
    assert g.node._driver.arming.reason == "the operator let the deadman go"


def test_another_owner_of_the_arming_state_forbids_to_arm_while_it_is_there(
    graph, vertiq_emulator, monkeypatch
):
    monkeypatch.setattr(arming, "PAUSE_FORGOTTEN_S", 4.0)  # longer than a busy computer stalls
    g = graph(RotorNode, port=vertiq_emulator.port, **PATIENT)
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    simulator = g.peer.create_publisher(DiagnosticArray, "arming/state", 10)
    simulator.publish(b"no message at all")  # bytes that are none end no node
    status = DiagnosticStatus(level=DiagnosticStatus.OK, hardware_id="/fish/simulator 0123abcd")
    asks = g.arming(publisher)
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, asks)

    def each() -> None:
        simulator.publish(DiagnosticArray(status=[status]))
        asks()

    assert g.spin(lambda: vertiq_emulator.mode == iquart.COAST, each)
    assert g.node._driver.arming.reason.startswith("/fish/simulator says arming/state, too")
    end = time.monotonic() + 1.0
    assert g.spin(lambda: time.monotonic() > end, each)
    assert vertiq_emulator.mode == iquart.COAST
    assert g.spin(lambda: vertiq_emulator.mode == VELOCITY_MODE, asks)  # it is gone


def test_arming_is_refused_without_an_estimate_and_says_what_lacks(graph, vertiq_emulator):
    g = graph(RotorNode, port=vertiq_emulator.port, reply_timeout_s=0.2)
    answer = g.call(SetBool, "arm", SetBool.Request(data=True))
    assert not answer.success
    for missing in ("joint_command", "odometry/filtered", "camera/pose", "word of the rudder"):
        assert f"no {missing} yet" in answer.message


def test_rudder_follows_and_centres(graph, tmp_path):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    g = graph(RudderNode, chip=str(chip.chip))
    diagnostics = g.listen(DiagnosticArray, "/diagnostics")
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    owner = g.peer.create_publisher(DiagnosticArray, "arming/state", 10)
    armed = DiagnosticArray(status=[DiagnosticStatus(level=DiagnosticStatus.OK, message="armed")])

    def recorded() -> None:
        publisher.publish(command(rudder=0.5))
        armed.header.stamp.sec = 1_700_000_000
        owner.publish(armed)

    def each() -> None:
        publisher.publish(command(rudder=0.5))
        armed.header.stamp = g.peer.get_clock().now().to_msg()
        owner.publish(armed)

    said = []
    assert g.spin(lambda: said.append(chip.read("duty_cycle")) or len(said) > 50, recorded)
    assert set(said) == {1_500_000}
    assert g.spin(lambda: chip.channel.joinpath("duty_cycle").read_text() == "1786500\n", each)
    assert g.spin(lambda: chip.channel.joinpath("duty_cycle").read_text() == "1500000\n")
    assert g.spin(lambda: bool(diagnostics))


def test_a_second_owner_does_not_move_the_rudder_of_a_disarmed_robot(graph, tmp_path):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    g = graph(RudderNode, chip=str(chip.chip))
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    owners = [g.peer.create_publisher(DiagnosticArray, "arming/state", 10) for _ in range(2)]
    states = [
        DiagnosticStatus(level=DiagnosticStatus.WARN, message="a leak", hardware_id="/fish/rotor"),
        DiagnosticStatus(level=DiagnosticStatus.OK, message="armed", hardware_id="/fish/replayer"),
    ]

    def say(index: int) -> None:
        message = DiagnosticArray(status=states[index : index + 1])
        message.header.stamp = g.peer.get_clock().now().to_msg()
        owners[index].publish(message)

    def disarmed() -> None:
        say(0)

    def each() -> None:
        disarmed()
        say(1)
        publisher.publish(command(rudder=0.5))

    assert g.spin(lambda: g.node._arming.armed is False, disarmed)
    assert g.spin(lambda: "/fish/replayer" in g.node._arming.reason, each)
    pulses = []
    assert g.spin(lambda: pulses.append(chip.read("duty_cycle")) or len(pulses) > 50, each)
    assert set(pulses) == {1_500_000}


def test_imu_topics(graph):
    g = graph(ImuNode, bus="emulator")
    data = g.listen(Imu, "imu/data")
    diagnostics = g.listen(DiagnosticArray, "/diagnostics")
    assert g.spin(lambda: len(data) > 30 and bool(diagnostics))
    message = data[-1]
    assert message.header.frame_id == "imu_link"
    assert 0.0 <= age_s(g, message.header.stamp) < 1.0
    assert message.linear_acceleration.z == pytest.approx(9.8, abs=0.5)
    assert 0.0 < abs(message.angular_velocity.z) < 0.51
    assert message.orientation.z**2 + message.orientation.w**2 == pytest.approx(1.0, abs=1e-3)
    assert message.orientation_covariance[0] == pytest.approx(0.044**2)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in data]
    assert stamps == sorted(stamps)
    assert diagnostics[0].status[0].level == DiagnosticStatus.WARN  # says that it is emulated
    assert "emulated" in diagnostics[0].status[0].message


def test_imu_message_keeps_every_axis(graph):
    """The emulated sensor turns about one axis only."""
    g = graph(
        ImuNode,
        bus="emulator",
        orientation_stdev=0.1,
        angular_velocity_stdev=0.2,
        linear_acceleration_stdev=0.3,
    )
    sample = ImuSample(1.0, (0.1, 0.2, 0.3, 0.9), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 3)
    message = deserialize_message(g.node._message(sample), Imu)
    assert message.header.frame_id == "imu_link"
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    assert (q.x, q.y, q.z, q.w) == (0.1, 0.2, 0.3, 0.9)
    assert (w.x, w.y, w.z, a.x, a.y, a.z) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    for covariance, stddev in (
        (message.orientation_covariance, 0.1),
        (message.angular_velocity_covariance, 0.2),
        (message.linear_acceleration_covariance, 0.3),
    ):
        assert covariance.reshape(3, 3) == pytest.approx(stddev**2 * np.eye(3))


def test_a_stamp_is_the_ros_time_of_the_moment(graph):
    g = graph(RudderNode, backend="emulator")
    assert (
        4.99 < age_s(g, g.node.stamp(time.monotonic() - 5.0)) < 15.0
    )  # a busy computer looks later


def test_camera_topics(graph):
    g = graph(CameraNode, device="emulator", width=160, height=120, publish_raw=True)
    compressed = g.listen(CompressedImage, "camera/image_raw/compressed")
    info = g.listen(CameraInfo, "camera/camera_info")
    raw = g.listen(Image, "camera/image_raw")
    assert g.spin(lambda: min(len(compressed), len(info), len(raw)) > 5)
    assert compressed[-1].header.frame_id == "overhead_optical"
    assert jpeg_size(bytes(compressed[-1].data)) == (160, 120)
    stamps = [
        {(m.header.stamp.sec, m.header.stamp.nanosec) for m in topic}
        for topic in (compressed, info, raw)
    ]
    assert len(stamps[0] & stamps[1] & stamps[2]) > 3
    assert (raw[-1].encoding, raw[-1].step, len(raw[-1].data)) == ("bgr8", 480, 160 * 120 * 3)


CALIBRATION = """
image_width: 160
image_height: 120
distortion_model: plumb_bob
camera_matrix: {data: [101, 0, 81, 0, 102, 62, 0, 0, 1]}
distortion_coefficients: {data: [-0.2, 0.05, 0.001, 0.002, 0.01]}
rectification_matrix: {data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {data: [103, 0, 83, 0, 0, 104, 64, 0, 0, 0, 1, 0]}
"""


def test_camera_info_is_the_calibration_of_the_file(graph, tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(CALIBRATION)
    g = graph(CameraNode, device="emulator", width=160, height=120, calibration_file=str(path))
    infos = g.listen(CameraInfo, "camera/camera_info")
    assert g.spin(lambda: bool(infos))
    info = infos[0]
    assert (info.width, info.height, info.distortion_model) == (160, 120, "plumb_bob")
    assert list(info.k) == [101, 0, 81, 0, 102, 62, 0, 0, 1]
    assert list(info.d) == [-0.2, 0.05, 0.001, 0.002, 0.01]
    assert list(info.r) == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert list(info.p) == [103, 0, 83, 0, 0, 104, 64, 0, 0, 0, 1, 0]


def test_a_calibration_of_another_size_is_refused(graph, tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(CALIBRATION)
    with pytest.raises(CameraFileError, match="is for 160x120 px, the camera is set to 320x240"):
        graph(CameraNode, device="emulator", width=320, height=240, calibration_file=str(path))


def set_camera_info(g, **changed):
    """The answer of the service to a calibration of the emulated camera."""
    info = CameraInfo(width=160, height=120, distortion_model="plumb_bob", d=[-0.1, 0, 0, 0, 0])
    info.k, info.r = [90.0, 0, 80, 0, 91, 60, 0, 0, 1], np.eye(3).ravel()
    info.p = [90.0, 0, 80, 0, 0, 91, 60, 0, 0, 0, 1, 0]
    for name, value in changed.items():
        setattr(info, name, value)
    return g.call(SetCameraInfo, "camera/set_camera_info", SetCameraInfo.Request(camera_info=info))


@pytest.mark.parametrize("named", [True, False])
def test_a_calibration_of_camera_calibration_is_saved_and_used(graph, tmp_path, monkeypatch, named):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    path = tmp_path / "camera.yaml" if named else tmp_path / "camera_info" / "overhead_optical.yaml"
    if named:
        path.write_text(CALIBRATION)
    given = {"calibration_file": str(path)} if named else {}
    g = graph(CameraNode, device="emulator", width=160, height=120, **given)
    infos = g.listen(CameraInfo, "camera/camera_info")
    answer = set_camera_info(g)
    assert answer.success
    assert answer.status_message.startswith(f"saved in {path}")
    assert ("set calibration_file" in answer.status_message) == (not named)
    assert g.spin(lambda: infos and infos[-1].k[0] == 90.0)
    assert read_camera_file(path).camera_matrix[0] == 90.0


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"width": 320}, "is for 320x120 px, the camera is set to 160x120"),
        ({"k": [0.0] * 9}, "focal lengths 0, 0"),
        ({"distortion_model": "curved"}, "expected one of plumb_bob"),
        ({"d": [math.nan] * 5}, "expected 5 or 4 or 0 finite numbers"),
        ({"d": [1e300] * 5}, "expected a distortion in which every corner"),
        ({"k": [1e300, 0, 80, 0, 1, 60, 0, 0, 1]}, "focal lengths 1e+300, 1, expected"),
        ({"r": np.zeros(9)}, "rectification_matrix is [0, 0, 0, 0, 0, 0, 0, 0, 0], expected"),
        ({"p": np.zeros(12)}, "projection_matrix has focal lengths 0, 0, expected"),
    ],
)
def test_an_impossible_calibration_is_refused_and_the_file_kept(graph, tmp_path, changed, said):
    path = tmp_path / "camera.yaml"
    path.write_text(CALIBRATION)
    g = graph(CameraNode, device="emulator", width=160, height=120, calibration_file=str(path))
    answer = set_camera_info(g, **changed)
    assert not answer.success
    assert said in answer.status_message
    assert path.read_text() == CALIBRATION
    assert [file.name for file in tmp_path.iterdir()] == ["camera.yaml"]


def test_a_step_that_raises_ends_the_node_and_leaves_the_device_safe(graph, tmp_path, monkeypatch):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    g = graph(RudderNode, chip=str(chip.chip))
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    monkeypatch.setattr(g.node._driver.servo, "step", lambda _: 1 / 0)
    assert wait_until(lambda: not g.node.context.ok(), TIMEOUT_S)
    assert chip.read("enable") == 0
    assert g.node.failure == "the device's thread ended unexpectedly"


def test_losses_are_logged_as_errors_and_doubts_as_warnings(graph, monkeypatch):
    g = graph(RudderNode, backend="emulator")
    said = []
    logger = SimpleNamespace(
        info=lambda text: said.append(("info", text)),
        warning=lambda text: said.append(("warning", text)),
        error=lambda text: said.append(("error", text)),
    )
    monkeypatch.setattr(g.node, "get_logger", lambda: logger)
    g.node.log_events([Loss("gone"), "back", Doubt("odd")])
    assert {("error", "gone"), ("info", "back"), ("warning", "odd")} <= set(said)


@pytest.mark.parametrize("node_class", [RotorNode, RudderNode, ImuNode, CameraNode])
def test_a_misspelt_parameter_is_refused_before_the_device_is_opened(graph, node_class):
    with pytest.raises(
        ValueError, match=r"unknown parameter rate_zh \(did you mean rate_hz\?\); known: "
    ):
        graph(node_class, rate_zh=50.0, use_sim_time="true")


def test_port_that_appears_later(graph, tmp_path, capfd):
    g = graph(RudderNode, chip=str(tmp_path / "pwmchip0"))
    diagnostics = g.listen(DiagnosticArray, "/diagnostics")
    assert g.spin(
        lambda: bool(diagnostics) and diagnostics[-1].status[0].level == DiagnosticStatus.ERROR
    )
    said = [
        line
        for line in capfd.readouterr().err.splitlines()
        if diagnostics[-1].status[0].message in line
    ]
    assert any(
        "trying until" not in line for line in said
    )  # the status itself, beside the first try's error
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    assert g.spin(lambda: chip.channel.joinpath("enable").read_text() == "1\n")


NODES = {
    "rotor": ["-p", "port:=emulator", "-p", "reply_timeout_s:=0.2"],  # a busy computer answers late
    "rudder": ["-p", "backend:=emulator"],
    "imu": ["-p", "bus:=emulator"],
    "camera": ["-p", "device:=emulator", "-p", "width:=160", "-p", "height:=120"],
}


STARTED: list[subprocess.Popen] = []


@pytest.fixture(autouse=True)
def nothing_left_running():
    """Processes of a test that failed must not disturb the next."""
    yield
    while STARTED:
        STARTED.pop().kill()


def start(name: str, *arguments: str) -> subprocess.Popen:
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(DOMAIN),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONUNBUFFERED": "1",
    }
    process = subprocess.Popen(
        [sys.executable, "-m", f"fish_hw.nodes.{name}", "--ros-args", *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    STARTED.append(process)
    return process


def first_words(process: subprocess.Popen, words: str) -> None:
    """Wait for a line of output that contains words."""
    said = ""
    for line in process.stdout:
        said += line
        if words in line:
            return
    raise AssertionError(
        f"the process ended with {process.wait(TIMEOUT_S)} without saying {words!r}:\n{said}"
    )


@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_signals_end_with_zero(first):
    """All four at once; rotor and imu get the first signal, the others the second."""
    second = signal.SIGTERM if first == signal.SIGINT else signal.SIGINT
    processes = {name: start(name, *arguments) for name, arguments in NODES.items()}
    for process in processes.values():
        first_words(process, "emulated device ready")
    for name, process in processes.items():
        process.send_signal(first if name in ("rotor", "imu") else second)
    for name, process in processes.items():
        output, _ = process.communicate(timeout=TIMEOUT_S)
        stuck = "Timeout (" in output and "in destroy_node" in output  # in Fast DDS: ended_within
        assert process.returncode == (1 if stuck else 0), f"{name}: {output}"
        assert "Traceback" not in output, name


@pytest.fixture
def own_process(monkeypatch):
    """This process as that of a node: run() takes its arguments. It must not leave the signals ignored as run() does."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    return lambda *arguments: monkeypatch.setattr(sys, "argv", ["node", "--ros-args", *arguments])


def signalled(number: signal.Signals, after: Callable) -> Callable:
    """`after`, followed by a signal that has done its work when this returns; SIGINT interrupts it."""

    def wrapped(*arguments):
        result = after(*arguments)
        os.kill(os.getpid(), number)
        assert wait_until(lambda: not rclpy.ok(), TIMEOUT_S)
        return result

    return wrapped


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "moment", ["node made", "output opened", "pulses on", "connected", "worker made"]
)
def test_a_signal_at_any_moment_of_the_start_leaves_the_device_safe(
    own_process, tmp_path, monkeypatch, capfd, number, moment
):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    own_process("-p", f"chip:={chip.chip}")
    make_node = signalled(number, RudderNode) if moment == "node made" else RudderNode
    places = {
        "output opened": (RudderNode, "_open_output"),
        "pulses on": (SysfsPwm, "start"),
        "connected": (RudderDriver, "connect"),
        "worker made": (Worker, "__init__"),
    }
    if moment in places:
        owner, name = places[moment]
        monkeypatch.setattr(owner, name, signalled(number, getattr(owner, name)))
    run(make_node, "rudder")
    assert chip.read("enable") == 0
    assert moment in ("node made", "output opened") or chip.read("duty_cycle") == 1_500_000
    assert "Traceback" not in capfd.readouterr().err
    assert not rclpy.ok()


def driven_rotor(
    emulator: VertiqEmulator, graph: Callable, **changed: float
) -> tuple[subprocess.Popen, Graph]:
    """A rotor process that spins the emulated module, commanded from here."""
    values = {**PATIENT, **changed, "port": emulator.port}
    process = start("rotor", *(a for k, v in values.items() for a in ("-p", f"{k}:={v}")))
    first_words(process, "device ready")
    g = graph(RudderNode, backend="emulator")  # any node: this side needs an executor only
    publisher = g.peer.create_publisher(JointState, "joint_command", 10)
    assert g.spin(lambda: emulator.mode == VELOCITY_MODE, g.arming(publisher))
    return process, g


def test_sigterm_coasts_a_spinning_rotor(graph, vertiq_emulator):
    process, _ = driven_rotor(vertiq_emulator, graph)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0
    assert vertiq_emulator.mode == iquart.COAST
    assert vertiq_emulator.timeouts == 0


def test_sigkill_leaves_it_to_the_modules_own_watchdog(graph, vertiq_emulator):
    process, _ = driven_rotor(vertiq_emulator, graph, module_timeout_s=0.25)
    process.kill()
    process.communicate(timeout=TIMEOUT_S)
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert vertiq_emulator.timeouts >= 1
    assert vertiq_emulator.timeout_s == 0.25


def test_a_port_that_is_absent_for_longer_than_allowed_is_named_and_ends_the_node():
    process = start("rotor", "-p", "port:=/dev/ttyX9", "-p", "startup_timeout_s:=0.1")
    output, _ = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 1
    last = output.splitlines()[-1]
    assert last.startswith(
        "rotor: cannot open serial port /dev/ttyX9: there is no such port; available: "
    )
    assert "Traceback" not in output


@pytest.mark.parametrize("port", ["/dev/ttyAMA0", "/dev/serial0"])
def test_a_real_motor_in_simulated_time_is_refused(graph, port):
    with pytest.raises(ValueError, match=f"use_sim_time is true and port is {port}: a real motor"):
        graph(RotorNode, port=port, use_sim_time=True)
