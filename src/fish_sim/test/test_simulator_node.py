# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node simulator: its messages, its clock, and how it ends."""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, Imu, JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from fish_node import rivals
from fish_node.pool import LENGTH
from fish_sim.nodes import simulator
from fish_sim.nodes import simulator_messages as messages
from fish_sim.nodes.pacing import AHEAD
from fish_sim.nodes.simulator import SimulatorNode
from fish_sim.robot import Robot, RobotError
from fish_sim.robot_file import save_robot
from fish_sim.sensors.onboard import ImuSample
from fish_sim.sensors.overhead_camera import CameraPose
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation import Truth
from fish_sim.simulation_config import SimulatorConfig

pytestmark = pytest.mark.ros


DOMAIN = 139  # no other test uses it; the tests of fish_node run at the same time, in 143
FAST = {"real_time_factor": 0.0, "disturbance": 0.0}
TOPICS = {
    "joint_states": JointState,
    "imu/data": Imu,
    "sim/odometry": Odometry,
    "sim/joint_states": JointState,
    "battery_state": BatteryState,
    "camera/pose": PoseWithCovarianceStamped,
    "arming/state": DiagnosticArray,
    "/diagnostics": DiagnosticArray,
}


def seconds(stamp) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec


class Bench:
    """A simulator node and a listener that also commands, spun by hand."""

    def __init__(self, parameters: dict[str, object]) -> None:
        arguments = ["--ros-args"] + [a for k, v in parameters.items() for a in ("-p", f"{k}:={v}")]
        rclpy.init(args=arguments, domain_id=DOMAIN)
        self.simulator, self.peer = SimulatorNode(), Node("peer", namespace="fish")
        self.got: dict[str, list] = defaultdict(list)
        for topic, kind in TOPICS.items():
            self.peer.create_subscription(kind, topic, self.got[topic].append, 1000)
        self.peer.create_subscription(
            Clock, "/clock", self.got["/clock"].append, qos_profile_sensor_data
        )
        self.commands = self.peer.create_publisher(JointState, "joint_command", 10)
        self.executor = SingleThreadedExecutor()
        for node in (self.simulator, self.peer):
            self.executor.add_node(node)

    def until(self, condition, spins: int = 20000) -> None:
        """Spin until condition() holds; fail after a number of callbacks, not of seconds."""
        for _ in range(spins):
            if condition():
                return
            self.executor.spin_once(timeout_sec=1.0)
        pytest.fail("the condition never came true")

    def collect(self, topic: str, count: int) -> list:
        """The next `count` messages of a topic."""
        start = len(self.got[topic])
        self.until(lambda: len(self.got[topic]) >= start + count)
        return self.got[topic][start:]

    def call(self, kind, name: str, request):
        client = self.peer.create_client(kind, name)
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def command(self, rotor: float, rudder: float, stamp: Time | None = None) -> None:
        command = JointState(
            name=["rotor", "rudder"], position=[0.0, rudder], velocity=[rotor, 0.0]
        )
        command.header.stamp = stamp or Time()
        self.commands.publish(command)

    def arm(self) -> None:
        """As an operator does while commands come."""
        client = self.peer.create_client(SetBool, "arm")
        for spin in range(20000):
            if spin % 5 == 0:
                self.command(0.0, 0.0)
                client.call_async(SetBool.Request(data=True))
            self.executor.spin_once(timeout_sec=1.0)
            if self.got["arming/state"] and self.armed():
                return
        pytest.fail("arming was refused")

    def armed(self) -> bool:
        return self.got["arming/state"][-1].status[0].level == DiagnosticStatus.OK

    def close(self) -> None:
        self.executor.shutdown()
        for node in (self.simulator, self.peer):
            node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench({**FAST, **getattr(request, "param", {})})
    yield made
    made.close()


@pytest.mark.parametrize("bench", [{"camera": "pose", "start_x": 0.5}], indirect=True)
def test_every_topic_has_its_type_frame_and_rate(bench):
    bench.collect("battery_state", 2)
    bench.collect("sim/odometry", 120)
    odometry, imu = bench.got["sim/odometry"], bench.got["imu/data"]
    stamps = [seconds(m.header.stamp) for m in odometry]
    assert all(b - a == pytest.approx(0.01, abs=1e-5) for a, b in itertools.pairwise(stamps))
    assert odometry[0].header.frame_id == "pool"
    assert odometry[0].child_frame_id == "base_link"
    assert odometry[0].pose.pose.position.x == pytest.approx(0.5)
    assert imu[0].header.frame_id == "imu_link"
    assert imu[0].linear_acceleration.z == pytest.approx(9.81, abs=0.5)
    assert imu[0].angular_velocity_covariance[8] == pytest.approx(0.006**2)
    assert bench.got["joint_states"][0].name == ["rotor"]
    assert bench.got["sim/joint_states"][0].name == ["tail_1", "tail_2", "tail_3"]
    assert 11.0 < bench.got["battery_state"][0].voltage < 13.0
    pose = bench.got["camera/pose"]
    assert pose[0].header.frame_id == "pool"
    assert pose[0].pose.covariance[0] == pytest.approx(0.002**2)
    gap = seconds(pose[-1].header.stamp) - seconds(pose[0].header.stamp)
    assert gap / (len(pose) - 1) == pytest.approx(1 / 30, rel=0.1)
    assert seconds(bench.got["/clock"][-1].clock) >= stamps[-2]
    status = bench.collect("/diagnostics", 1)[-1].status[0]
    said = "disarmed: not armed since the start"
    assert (status.level, status.message) == (DiagnosticStatus.WARN, said)


def test_a_commanded_fish_stays_where_it_is_until_it_is_armed(bench):
    bench.collect("sim/odometry", 1)
    for _ in range(50):
        bench.command(100.0, 0.3)
        bench.collect("sim/odometry", 1)
    assert all(abs(m.velocity[0]) < 2.0 for m in bench.got["joint_states"])  # the encoder's noise
    assert max(abs(m.twist.twist.linear.x) for m in bench.got["sim/odometry"]) < 0.01


def test_silence_of_the_commands_disarms_for_good(bench):
    bench.arm()
    for _ in range(20):
        bench.command(100.0, 0.0)
        bench.collect("sim/odometry", 1)
    bench.until(lambda: not bench.armed())
    assert bench.got["arming/state"][-1].status[0].message == "no joint_command for 1.25 s"
    bench.collect("sim/odometry", 20)
    for _ in range(50):
        bench.command(100.0, 0.0)
        bench.collect("sim/odometry", 1)
    assert all(abs(m.velocity[0]) < 2.0 for m in bench.got["joint_states"][-50:])
    assert not bench.armed()


def test_a_commanded_fish_swims_and_the_truth_says_so(bench):
    bench.arm()
    for _ in range(150):
        phase = 4 * math.pi * seconds(bench.got["sim/odometry"][-1].header.stamp)
        bench.command(100 * math.sin(phase), 0.0)
        bench.collect("sim/odometry", 1)
    assert max(m.twist.twist.linear.x for m in bench.got["sim/odometry"]) > 0.05
    assert max(abs(m.velocity[0]) for m in bench.got["joint_states"]) > 80.0
    assert bench.got["camera/pose"] == []  # camera: image, the default


def test_pause_stops_time_and_reset_brings_the_fish_back_without_turning_time_back(bench):
    for _ in range(50):
        bench.command(100.0, 0.3)
        bench.collect("sim/odometry", 1)
    assert bench.call(SetBool, "pause", SetBool.Request(data=True)).message == "paused"
    bench.collect("/diagnostics", 1)  # whatever was under way has arrived by then
    stopped = seconds(bench.got["sim/odometry"][-1].header.stamp)
    bench.collect("/diagnostics", 1)
    assert seconds(bench.got["sim/odometry"][-1].header.stamp) == stopped
    assert bench.got["/diagnostics"][-1].status[0].message == "paused"
    assert bench.call(Trigger, "reset", Trigger.Request()).success
    assert bench.call(SetBool, "pause", SetBool.Request(data=False)).message == "running"
    message = bench.collect("sim/odometry", 3)[-1]
    assert seconds(message.header.stamp) > stopped
    assert abs(message.pose.pose.position.x) < 1e-6
    assert abs(message.twist.twist.angular.z) < 1e-6


@pytest.mark.parametrize("bench", [{"lockstep": 60.0}], indirect=True)
def test_in_lockstep_time_stands_until_the_command_is_answered(bench):
    answered = bench.collect("sim/odometry", 1)[0].header.stamp
    for _ in range(2):
        bench.command(0.0, 0.0, answered)
        bench.collect("/diagnostics", 2)  # seconds in which thousands of periods would have run
        stands = bench.got["sim/odometry"][-1].header.stamp
        assert seconds(stands) - seconds(answered) < AHEAD + 0.015
        answered = stands
    bench.command(0.0, 0.0, answered)
    assert seconds(bench.collect("sim/odometry", 1)[0].header.stamp) > seconds(answered)


@pytest.mark.parametrize("bench", [{"lockstep": 60.0, "lockstep_camera": 0.15}], indirect=True)
def test_in_lockstep_time_stands_while_the_tracker_lags(bench):
    """A busy computer draws and tracks late; poses that come later and later look like a clock that was set."""
    poses = bench.peer.create_publisher(PoseWithCovarianceStamped, "camera/pose", 10)
    bench.until(lambda: poses.get_subscription_count() >= 3)  # the arming, lockstep, this bench
    words = bench.peer.create_publisher(Header, "lockstep", 10)
    for kind in ("pose", "pose", "no pose"):
        seen = bench.collect("sim/odometry", 1)[0].header
        if kind == "pose":
            poses.publish(PoseWithCovarianceStamped(header=seen))
        else:
            words.publish(Header(stamp=seen.stamp, frame_id="tracker"))

        def lag(seen=seen) -> float:
            bench.command(0.0, 0.0, bench.got["sim/odometry"][-1].header.stamp)
            return seconds(bench.got["sim/odometry"][-1].header.stamp) - seconds(seen.stamp)

        bench.until(lambda lag=lag: lag() > 0.13)
        said = len(bench.got["/diagnostics"]) + 2  # two seconds later, whatever was under way
        bench.until(lambda lag=lag, said=said: lag() and len(bench.got["/diagnostics"]) >= said)
        assert lag() < 0.15 + AHEAD + 0.015


@pytest.mark.parametrize("bench", [{"lockstep": 60.0}], indirect=True)
def test_in_lockstep_the_newest_imu_sample_is_said_again_while_time_stands(bench):
    """Fusion takes the IMU best-effort: a sample that it missed, it would wait for for ever."""
    bench.command(0.0, 0.0, bench.collect("sim/odometry", 1)[0].header.stamp)
    again = bench.collect("imu/data", 8)[-2:]
    assert again[0] == again[1]
    assert seconds(again[1].header.stamp) == seconds(bench.got["sim/odometry"][-1].header.stamp)


@pytest.mark.parametrize("bench", [{"lockstep": 60.0}], indirect=True)
def test_in_lockstep_a_commander_that_is_late_loses_no_period(bench):
    """Each answer comes only after many spins in which nothing else happens; every period still gets its command."""
    answered = []
    for _ in range(30):
        newest = bench.collect("/clock", 4)[-1].clock
        answered.append(newest)
        bench.command(0.0, 0.0, newest)
        bench.until(lambda now=newest: seconds(bench.got["/clock"][-1].clock) > seconds(now))
    stamps = [seconds(stamp) for stamp in answered[4:]]
    assert all(b - a == pytest.approx(0.01, abs=1e-6) for a, b in itertools.pairwise(stamps))


@pytest.mark.parametrize("bench", [{"start_x": 2.1}], indirect=True)
def test_a_fish_that_comes_to_a_wall_stops_there_and_is_said_once(bench, capfd):
    bench.arm()
    for _ in range(400):
        phase = 4 * math.pi * seconds(bench.got["sim/odometry"][-1].header.stamp)
        bench.command(100 * math.sin(phase), 0.0)
        bench.collect("sim/odometry", 1)
    assert max(m.pose.pose.position.x for m in bench.got["sim/odometry"]) == LENGTH / 2
    bench.call(SetBool, "pause", SetBool.Request(data=True))
    said = bench.collect("/diagnostics", 2)[-1]
    contacts = int(dict_of(said)["wall_contacts"])
    assert contacts >= 1
    lines = [
        line
        for line in capfd.readouterr().err.splitlines()
        if "came to the pool's wall at (2.1" in line
    ]
    assert len(lines) == contacts
    assert "[WARN]" in lines[0]


def test_bad_commands_are_refused_and_said_in_the_diagnostics(bench):
    bench.collect("sim/odometry", 1)
    for message in (
        JointState(name=["rotor"], velocity=[1.0]),
        JointState(name=["rotor", "rudder"], velocity=[1.0]),
        JointState(name=["rotor", "rudder"], position=[0.0, math.nan], velocity=[1.0, 0.0]),
        JointState(name=["rotor", "rudder"], position=[0.0, 0.0], velocity=[1e9, 0.0]),
    ):
        bench.commands.publish(message)
    bench.until(
        lambda: any(dict_of(m)["commands_refused"] == "4" for m in bench.got["/diagnostics"])
    )
    status = bench.got["/diagnostics"][-1].status[0]
    assert status.level == DiagnosticStatus.WARN
    assert "joint_command refused" in status.message
    assert status.name == "fish/simulator"


def dict_of(message: DiagnosticArray) -> dict[str, str]:
    return {pair.key: pair.value for pair in message.status[0].values}


@pytest.mark.parametrize("bench", [{"real_time_factor": 1.0}], indirect=True)
def test_at_factor_1_stamps_keep_to_the_wall_clock_also_after_a_pause(bench):
    def least_behind() -> float:
        """A busy computer may hold up a message, not all of them."""
        behind = []
        for _ in range(20):
            stamp = seconds(bench.collect("sim/odometry", 5)[-1].header.stamp)
            behind.append(bench.peer.get_clock().now().nanoseconds * 1e-9 - stamp)
        return min(behind)

    before = least_behind()
    said = dict_of(bench.collect("/diagnostics", 1)[-1])
    assert float(said["simulated_s"]) > 0.9
    skipped = float(said["lost_s"])  # of what it could not keep up with
    assert -0.01 < before < 0.3 + skipped
    bench.call(SetBool, "pause", SetBool.Request(data=True))
    bench.collect("/diagnostics", 2)
    bench.call(SetBool, "pause", SetBool.Request(data=False))
    after = least_behind()
    assert -0.01 < after < 0.3 + float(dict_of(bench.got["/diagnostics"][-1])["lost_s"])


def test_a_robot_file_is_used_and_a_broken_one_refused(tmp_path):
    save_robot(Robot(links=2), tmp_path / "robot.yaml")
    bench = Bench({**FAST, "robot_file": tmp_path / "robot.yaml"})
    try:
        assert bench.collect("sim/joint_states", 1)[0].name == ["tail_1", "tail_2"]
    finally:
        bench.close()
    (tmp_path / "robot.yaml").write_text("format: 1\nlinks: 0")
    rclpy.init(
        args=["--ros-args", "-p", f"robot_file:={tmp_path / 'robot.yaml'}"], domain_id=DOMAIN
    )
    try:
        with pytest.raises(RobotError, match="links: got 0"):
            SimulatorNode()
    finally:
        rclpy.try_shutdown()


def test_a_second_simulator_is_warned_of_on_diagnostics_and_console(bench, monkeypatch, capfd):
    monkeypatch.setattr(rivals, "PATIENCE_S", 0.0)
    bench.peer.create_publisher(Odometry, "sim/odometry", 10)
    warning = "another publisher of /fish/sim/odometry"
    bench.until(
        lambda: any(warning in array.status[0].message for array in bench.got["/diagnostics"])
    )
    assert bench.got["/diagnostics"][-1].status[0].level == DiagnosticStatus.WARN
    said = [line for line in capfd.readouterr().err.splitlines() if warning in line]
    assert len(said) == 1
    assert "[WARN]" in said[0]


def test_a_misspelt_parameter_is_refused():
    with pytest.raises(ValueError, match=r"unknown parameter start_z \(did you mean start_"):
        Bench({"start_z": 0.0})
    rclpy.try_shutdown()


@pytest.mark.parametrize("camera", ["image", "pose"])
def test_camera_effects_that_a_picture_does_not_show_are_said_at_the_start(tmp_path, capfd, camera):
    save_robot(Robot().with_effect("camera_scale", factor=1.05), tmp_path / "robot.yaml")
    Bench({**FAST, "robot_file": tmp_path / "robot.yaml", "camera": camera, "paused": True}).close()
    said = [line for line in capfd.readouterr().err.splitlines() if "sensors.camera_scale" in line]
    assert len(said) == (camera == "image")
    assert all("WARN" in line and "robot.yaml" in line and "camera:=pose" in line for line in said)


def test_shipped_parameters_are_those_of_the_dataclass():
    file = Path(__file__).parent.parent / "config" / "simulator.yaml"
    values = yaml.safe_load(file.read_text())["/**"]["ros__parameters"]
    assert SimulatorConfig(**values) == SimulatorConfig()


HEADER = Header(frame_id="frame")
STAMP = Time(sec=12, nanosec=345)
FRAMES = "pool", "fish_2/base_link", "fish_2/imu_link"
TRUTH = Truth((1.0, 2.0, 2.5), (0.3, -0.2, 1.5), (0.1, -0.1, 0.2))


def written(settings: SensorSettings | None = None) -> messages.PeriodMessages:
    return messages.PeriodMessages(FRAMES, 3, settings or SensorSettings())


def heading(orientation) -> float:
    assert orientation.x == orientation.y == 0.0
    return 2.0 * math.atan2(orientation.z, orientation.w)


@pytest.mark.parametrize(
    "names", [["rotor", "rudder"], ["rudder", "rotor"], ["other", "rudder", "rotor"]]
)
def test_a_command_is_read_by_name(names: list[str]) -> None:
    positions, speeds = {"rudder": 0.4}, {"rotor": 90.0}
    msg = JointState(name=names)
    msg.position = [positions.get(name, 7.0) for name in names]
    msg.velocity = [speeds.get(name, 7.0) for name in names]
    assert messages.command(msg) == (90.0, 0.4)


def test_odometry_is_the_truth() -> None:
    msg = deserialize_message(written().odometry(STAMP, TRUTH), Odometry)
    assert msg.header == Header(stamp=STAMP, frame_id="pool")
    assert msg.child_frame_id == "fish_2/base_link"
    assert not msg.pose.covariance.any()
    p, twist = msg.pose.pose.position, msg.twist.twist
    assert (p.x, p.y, p.z, heading(msg.pose.pose.orientation)) == pytest.approx(
        (1.0, 2.0, 0.0, 2.5)
    )
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, -0.2, 1.5)


def test_the_imu_keeps_axes_and_noise_apart() -> None:
    settings = SensorSettings(orientation_noise=0.1, gyro_noise=0.2, accelerometer_noise=0.3)
    sample = ImuSample(-0.7, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    msg = deserialize_message(written(settings).imu(STAMP, sample), Imu)
    assert msg.header == Header(stamp=STAMP, frame_id="fish_2/imu_link")
    w, a = msg.angular_velocity, msg.linear_acceleration
    assert heading(msg.orientation) == pytest.approx(-0.7)
    assert (w.x, w.y, w.z, a.x, a.y, a.z) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    for covariance, std in (
        (msg.orientation_covariance, 0.1),
        (msg.angular_velocity_covariance, 0.2),
        (msg.linear_acceleration_covariance, 0.3),
    ):
        np.testing.assert_allclose(covariance.reshape(3, 3), std**2 * np.eye(3))


def test_a_camera_pose_carries_its_noise_in_x_y_and_yaw() -> None:
    settings = SensorSettings(camera_position_noise=0.01, camera_heading_noise=0.2)
    msg = messages.camera_pose(HEADER, CameraPose(1.0, 1.05, -0.5, 0.25, 3.0), settings)
    p = msg.pose.pose.position
    assert (p.x, p.y, heading(msg.pose.pose.orientation)) == pytest.approx((-0.5, 0.25, 3.0))
    expected = np.diag([0.01**2, 0.01**2, 0.0, 0.0, 0.0, 0.2**2])
    np.testing.assert_allclose(msg.pose.covariance.reshape(6, 6), expected)


def test_encoder_and_tail_are_named_joints() -> None:
    out = written()
    rotor = deserialize_message(out.rotor(STAMP, (12.0, 80.0)), JointState)
    tail = deserialize_message(out.tail(STAMP, TRUTH), JointState)
    assert rotor.header == tail.header == Header(stamp=STAMP, frame_id="fish_2/base_link")
    assert (rotor.name, list(rotor.position), list(rotor.velocity)) == (["rotor"], [12.0], [80.0])
    assert (tail.name, list(tail.position)) == (["tail_1", "tail_2", "tail_3"], [0.1, -0.1, 0.2])


def test_the_clock_is_the_stamp_and_each_message_has_its_own() -> None:
    out = written()
    first, second = out.clock(STAMP), out.clock(Time(sec=13, nanosec=0))
    assert deserialize_message(first, Clock).clock == STAMP
    assert deserialize_message(second, Clock).clock == Time(sec=13, nanosec=0)


WALL_CLOCK_DOMAIN = 144


@pytest.fixture
def simulated():
    """simulated(parameter=value, ...): a simulator node."""
    nodes = []

    def make(**parameters):
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        rclpy.init(args=["--ros-args", *given], domain_id=WALL_CLOCK_DOMAIN)
        nodes.append(simulator.SimulatorNode())
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    if rclpy.ok():
        rclpy.shutdown()  # unlike try_shutdown it takes the signal handlers away


class Clocks:
    """Stands for the module time, with a wall clock that can be set."""

    def __init__(self):
        self.steady, self.wall = 50.0, 1.7e9

    def monotonic(self):
        return self.steady

    def time_ns(self):
        return round(self.wall * 1e9)

    def run(self, node, seconds):
        """Tick for a while; returns how much the last stamp is behind the wall clock [s]."""
        for _ in range(round(100 * seconds)):
            self.steady, self.wall = self.steady + 0.01, self.wall + 0.01
            node._tick()
        return (
            self.wall
            - node._stamp(node._simulation.time).sec
            - 1e-9 * node._stamp(node._simulation.time).nanosec
        )


@pytest.mark.parametrize("step", [3600.0, 0.5, -0.5, -3600.0])
def test_the_simulator_follows_a_wall_clock_that_is_set(simulated, monkeypatch, capfd, step):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated()
    assert abs(clocks.run(node, 1.0)) < 0.02
    assert node._simulation.time == pytest.approx(1.0, abs=0.02)
    clocks.wall += step
    assert abs(clocks.run(node, 1.0)) < 0.03
    assert node._simulation.time == pytest.approx(2.0, abs=0.05)
    assert node._pacer.lost == 0.0
    assert capfd.readouterr().err.count("the wall clock was set") == 1


@pytest.mark.parametrize(
    ("parameters", "step"),
    [({}, 0.1), ({"use_sim_time": "true"}, 60.0), ({"real_time_factor": 2.0}, 60.0)],
)
def test_the_simulators_time_stays_even_where_the_wall_clock_hardly_moved_or_is_not_followed(
    simulated, monkeypatch, parameters, step
):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated(**parameters)
    before = clocks.run(node, 0.5)
    clocks.wall += step
    assert clocks.run(node, 0.01) == pytest.approx(before + step, abs=0.05)


def test_a_simulator_that_was_held_up_counts_what_it_lost_and_is_not_called_set(
    simulated, monkeypatch, capfd
):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated()
    clocks.run(node, 0.5)
    clocks.steady, clocks.wall = clocks.steady + 3.0, clocks.wall + 3.0
    assert abs(clocks.run(node, 0.5)) < 0.03
    assert node._pacer.lost == pytest.approx(3.0, abs=0.02)
    clocks.steady, clocks.wall = clocks.steady + 0.15, clocks.wall + 0.15  # is caught up with
    assert abs(clocks.run(node, 0.1)) < 0.03
    assert node._pacer.lost == pytest.approx(3.0, abs=0.02)
    assert "the wall clock was set" not in capfd.readouterr().err
