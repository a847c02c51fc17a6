# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Importer of the real robot's ROS 1 bags, on a small bag of the same message types made here."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fish_bag import RecordingError, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.pool_import import CENTRE, import_bag
from fish_report import robofish as command

START = 1_700_000_000.0  # s, recorder's clock
ROBOT = -2_329_263.25  # s, robot's clock minus recorder's
CAMERA = -0.25  # s, camera's clock minus recorder's
DURATION = 8.0
FIELDS = {
    "cam_tracking_data": (
        "float64",
        "x_position y_position body_velocity z_angular_velocity tail_angle_1 head_angle tail_angle_2 Vx Vy",
    ),
    "motor_estimates": (
        "float64",
        "encoder_vel encoder_pos A omega servo_angle voltage current power PWM supply_volts temperature",
    ),
    "KFstate": ("float64", "x y z Vx Vy Vz vb_x vb_y vb_z roll pitch yaw"),
    "purepursuit_control": (
        "float32",
        "goal_x goal_y Ld error_yaw e_fa yaw_Kp yaw_Ki yaw_Kd curvature_des vel_Kp vel_Ki vel_Kd error_vel "
        "velocity_x_des throttle A omega servo_angle theta_p",
    ),
}


class Robot:
    """The rotor as the robot drives it: a held speed per loop, a lag of 6 ms, a phase that slips slowly."""

    def __init__(self) -> None:
        rng = np.random.default_rng(5)
        self.t_loop = 1.0 + np.cumsum(rng.uniform(0.016, 0.026, 260))
        self.A = np.where(np.sin(self.t_loop) > 0, 9.0, 7.5)
        self.f = np.where(np.sin(self.t_loop) > 0, 2.0, 2.5)
        self.servo_deg = 20 * np.sin(self.t_loop)
        steps = 2 * np.pi * self.f[1:] * np.diff(self.t_loop)
        theta = 0.7 + np.concatenate([[0], np.cumsum(steps)]) + 0.1 * np.sin(0.8 * self.t_loop)
        self.held = -self.A * 2 * np.pi * self.f * np.sin(theta)

    def speed(self, t: np.ndarray) -> np.ndarray:
        """Speed at t (closed form: the first-order answer to the staircase, stair by stair)."""
        lag, state, out = 0.006, 0.0, np.zeros(len(t))
        edges = np.append(self.t_loop, np.inf)
        for j, held in enumerate(self.held):
            inside = (t >= edges[j]) & (t < edges[j + 1])
            out[inside] = held + (state - held) * np.exp(-(t[inside] - edges[j]) / lag)
            state = held + (state - held) * np.exp(-(edges[j + 1] - edges[j]) / lag)
        return out


def store():
    types = get_typestore(Stores.ROS1_NOETIC)
    for name, (kind, fields) in FIELDS.items():
        text = "std_msgs/Header header\n" + "\n".join(f"{kind} {field}" for field in fields.split())
        types.register(get_types_from_msg(text, f"custom_msgs/msg/{name}"))
    return types


class Bag:
    """Messages of a ROS 1 bag, written in order of arrival."""

    def __init__(self) -> None:
        self.types, self.messages = store(), []

    def header(self, stamp: float, frame: str = "") -> object:
        total = round(stamp * 1e9)
        time = self.types.types["builtin_interfaces/msg/Time"](
            sec=total // 10**9, nanosec=total % 10**9
        )
        return self.types.types["std_msgs/msg/Header"](seq=0, stamp=time, frame_id=frame)

    def add(self, topic: str, kind: str, stamp: float, arrival: float, **values: float) -> None:
        fields = dict.fromkeys(FIELDS[kind][1].split(), 0.0) | values
        message = self.types.types[f"custom_msgs/msg/{kind}"](header=self.header(stamp), **fields)
        self.messages.append((arrival, topic, message))

    def write(self, path: Path) -> Path:
        with Writer(path) as writer:
            topics = {}
            for arrival, topic, message in sorted(self.messages, key=lambda m: m[0]):
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.types)
                raw = self.types.serialize_ros1(message, kind)
                writer.write(topics[topic], round((START + arrival) * 1e9), bytes(raw))
        return path


def robot_bag(path: Path) -> Path:
    bag, robot, rng = Bag(), Robot(), np.random.default_rng(6)
    robot_stamp, late = START + ROBOT, lambda: 0.001 + rng.exponential(0.002)
    for t in np.arange(0.5, DURATION, 1 / 17):
        bag.add(
            "/encoder_estimates",
            "motor_estimates",
            robot_stamp + t,
            t + late(),
            encoder_vel=-robot.speed(np.array([t - 0.042]))[0],
            encoder_pos=-0.1 * t,
            voltage=24.0 - t,
            current=0.5,
            temperature=40.0,
        )
    for i, t in enumerate(robot.t_loop):
        bag.add(
            "/purepursuit_target",
            "purepursuit_control",
            robot_stamp + t,
            t + late(),
            A=robot.A[i],
            omega=robot.f[i],
            servo_angle=robot.servo_deg[i],
            goal_x=2.0,
            goal_y=1.0,
            theta_p=0.25,
            e_fa=0.125,
            error_yaw=-0.5,
            error_vel=0.0625,
            velocity_x_des=0.25,
            yaw_Kp=1.0,
            yaw_Ki=2.0,
            yaw_Kd=3.0,
            vel_Kp=4.0,
            vel_Ki=5.0,
            vel_Kd=6.0,
        )
        bag.add(
            "/KF_state_estimate",
            "KFstate",
            robot_stamp + t,
            t + late(),
            x=t,
            y=0.5,
            yaw=0.3,
            vb_x=0.2,
            vb_y=0.1,
        )
    for i, t in enumerate(np.arange(0, DURATION, 1 / 11)):
        broken = np.nan if i == 30 else 1.0
        bag.add(
            "/runcam_tracking",
            "cam_tracking_data",
            START + CAMERA + t,
            t + 0.1 + late(),
            x_position=broken * t / 4,
            y_position=0.9,
            head_angle=170.0,
            tail_angle_1=-175.0,
            tail_angle_2=-170.0,
        )
    add_imu(bag, robot_stamp, late)
    add_path(bag)
    return bag.write(path)


def add_imu(bag: Bag, robot_stamp: float, late) -> None:
    """Polled at 60 Hz, a new sample every third poll; pitched by 30 degrees."""
    types = bag.types.types
    half = np.radians(15)
    for i, t in enumerate(np.arange(1.0, DURATION, 1 / 60)):
        sample = i // 3
        turn = types["geometry_msgs/msg/Quaternion"](
            x=0.0, y=np.sin(half), z=1e-6 * sample, w=np.cos(half)
        )
        vector = types["geometry_msgs/msg/Vector3"]
        message = types["sensor_msgs/msg/Imu"](
            header=bag.header(robot_stamp + t),
            orientation=turn,
            orientation_covariance=np.zeros(9),
            angular_velocity=vector(x=0.0, y=0.0, z=float(sample)),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(x=1.0, y=0.0, z=0.0),
            linear_acceleration_covariance=np.zeros(9),
        )
        bag.messages.append((t + late(), "/IMU_bno08x/raw", message))


def add_path(bag: Bag) -> None:
    types = bag.types.types
    poses = [
        types["geometry_msgs/msg/PoseStamped"](
            header=bag.header(START),
            pose=types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0),
                orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        for x, y in ((0.5, 0.9), (3.5, 1.0))
    ]
    path = types["nav_msgs/msg/Path"](header=bag.header(START, "world_frame"), poses=poses)
    bag.messages.append((0.01, "/runcam_path", path))


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pool")
    report = import_bag(robot_bag(folder / "run.bag"), folder / "run")
    return report, read_trial(report.directory)


def test_clocks(imported):
    report, trial = imported
    assert report.robot_offset_s == pytest.approx(-ROBOT + 0.001, abs=1e-4)
    assert report.camera_offset_s == pytest.approx(-CAMERA + 0.101, abs=2e-4)
    assert trial.axis == "recorder"
    zero = trial.origin_ns * 1e-9 - START
    assert trial.target.t[0] + zero == pytest.approx(Robot().t_loop[0] + 0.001, abs=1e-3)


def test_camera_and_tail(imported):
    _, trial = imported
    t = np.arange(0, DURATION, 1 / 11)
    assert len(trial.camera) == len(t)
    assert np.flatnonzero(trial.camera.flags).tolist() == [30]
    good = trial.clean().camera
    np.testing.assert_allclose(good.x, np.delete(t, 30) / 4 - CENTRE[0])
    np.testing.assert_allclose(good.y, 0.9 - CENTRE[1])
    np.testing.assert_allclose(good.psi, np.radians(170))
    np.testing.assert_allclose(trial.tail.angle, np.radians([[15, 5]] * len(t)))  # across the wrap


def test_encoder_battery_filter(imported):
    _, trial = imported
    np.testing.assert_allclose(trial.encoder.angle, 0.1 * np.arange(0.5, DURATION, 1 / 17))
    delay = trial.encoder.t_arrival - trial.encoder.t
    assert delay.min() == pytest.approx(0.042, abs=1e-3)
    np.testing.assert_allclose(np.diff(trial.battery.voltage), -1.0, atol=0.1)
    np.testing.assert_allclose(trial.odometry.x, Robot().t_loop - CENTRE[0])
    np.testing.assert_allclose([trial.odometry.u[0], trial.odometry.v[0]], [0.2, 0.1])


def test_imu_without_repeats_and_with_gravity(imported):
    _, trial = imported
    assert np.all(np.diff(trial.imu.gyro[:, 2]) == 1.0)
    force = [1.0 - 9.81 * np.sin(np.radians(30)), 0.0, 9.81 * np.cos(np.radians(30))]
    np.testing.assert_allclose(trial.imu.accel, [force] * len(trial.imu), atol=0.01)


def test_control(imported):
    _, trial = imported
    np.testing.assert_allclose(trial.target.x, 2.0 - CENTRE[0], rtol=1e-6)  # float32
    np.testing.assert_array_equal(trial.gains.values[0], [1, 2, 3, 4, 5, 6])
    assert trial.gains.names[0] == "steering_kp"
    e = trial.tracking_error
    assert (e.cross_track[0], e.heading[0], e.speed[0]) == (0.125, -0.5, 0.0625)
    assert trial.reference_speed.speed.tolist() == [0.25]
    np.testing.assert_allclose(trial.reference_path, np.array([[0.5, 0.9], [3.5, 1.0]]) - CENTRE)


def test_rotor_command_is_rebuilt(imported):
    report, trial = imported
    robot = Robot()
    t = trial.commands.t + trial.origin_ns * 1e-9 - START - 0.001  # as the robot's loops count
    during = (t > robot.t_loop[0] + 0.3) & (t < robot.t_loop[-1] - 0.1)
    error = trial.commands.rotor_speed[during] - robot.speed(t[during])
    assert report.rotor_residual < 2.0
    assert np.median(np.abs(error)) < 3.0, "of 141 rad/s"
    loop = np.searchsorted(robot.t_loop, t[during] - 1e-6, side="right") - 1
    alpha = -np.radians(robot.servo_deg)
    nearest = np.minimum.reduce(
        [
            np.abs(trial.commands.rudder[during] - alpha[np.clip(loop + k, 0, None)])
            for k in (-1, 0, 1)
        ]
    )
    assert nearest.max() < 1e-6
    np.testing.assert_allclose(np.diff(trial.commands.t), 0.01, atol=1e-6)


def test_command_line(tmp_path, capsys):
    robot_bag(tmp_path / "I_0.10.bag")
    assert command.main(["import_pool", str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    assert "I_0.10" in capsys.readouterr().out
    assert (tmp_path / "out" / "I_0.10" / "metadata.yaml").exists()


def test_other_recordings_are_refused(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=0.1)
    with pytest.raises(RecordingError, match="not a recording of the paper's robot"):
        import_bag(path, tmp_path / "b")


def test_reading_the_bag_itself_points_to_the_importer(tmp_path):
    with pytest.raises(RecordingError, match="robofish import_pool"):
        read_trial(robot_bag(tmp_path / "run.bag"))
