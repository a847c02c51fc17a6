# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fake robot's devices through the real drivers: what goes in comes out, and every fault can be mended."""

import errno
import math
import os
import time

import cv2
import numpy as np
import pytest
from waiting import wait_until

from fish_hw.devices.imu_driver import ImuDriver
from fish_hw.devices.rotor_watch import RotorWatch
from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.devices.usb_camera import UsbCamera
from fish_hw.devices.vertiq import Vertiq
from fish_hw.emulators.bno085 import Felt
from fish_hw.emulators.fake_robot import IMU_ADDRESS, FakeRobot
from fish_hw.protocol import iquart
from fish_hw.protocol.iquart import encode
from fish_hw.settings import CameraSettings, ImuSettings, RotorSettings, RudderSettings
from fish_hw.transport.interfaces import PortUnavailable, TransportError
from fish_hw.transport.serial_port import SerialPort
from fish_hw.transport.unix_socket import SocketCamera, SocketI2c

TIMEOUT_S = 15.0
TURNED = (0.0, 0.0, math.sin(0.4), math.cos(0.4))


@pytest.fixture
def robot(tmp_path):
    robot = FakeRobot(tmp_path / "fake", RudderSettings())
    yield robot
    robot.close()


def imu_driver(robot: FakeRobot) -> ImuDriver:
    bus = str(robot.parameters()["imu"]["bus"])
    driver = ImuDriver(ImuSettings(bus=bus), lambda: SocketI2c(bus), lambda: None, lambda: None)
    driver.connect()
    return driver


def felt(time_s: float, ahead: float = 1.0) -> Felt:
    return Felt(time_s, TURNED, (0.0, 0.0, 0.5), (ahead, -2.0, 9.8125))


def test_what_the_simulator_feels_comes_through_the_hubs_protocol(robot):
    driver = imu_driver(robot)
    samples = []

    def step() -> bool:
        noise = 0.1 * math.sin(time.monotonic() * 1e3)
        robot.imu.feel(felt(time.monotonic() - 0.02, 1.0 + noise))
        samples.extend(driver.step(0.01).samples)
        return len(samples) >= 10

    assert wait_until(step, TIMEOUT_S)
    sample = samples[-1]
    assert sample.angular_velocity == pytest.approx((0.0, 0.0, 0.5), abs=2e-3)
    assert sample.acceleration == pytest.approx((1.0, -2.0, 9.8125), abs=0.11)
    assert sample.orientation == pytest.approx(TURNED, abs=1e-3)
    assert 0.015 < time.monotonic() - sample.time_s < 5.0  # when it was felt, not when it was read
    driver.close()


@pytest.mark.parametrize("code", [errno.EIO, errno.ETIMEDOUT, errno.EREMOTEIO])
def test_an_errno_of_the_bus_reaches_the_driver(robot, code):
    bus = SocketI2c(str(robot.parameters()["imu"]["bus"]))
    assert len(bus.read(IMU_ADDRESS, 4)) == 4
    robot.bus.fault = lambda: code
    with pytest.raises(TransportError, match=os.strerror(code)):
        bus.read(IMU_ADDRESS, 4)
    robot.mend()
    assert len(bus.read(IMU_ADDRESS, 4)) == 4
    with pytest.raises(TransportError, match="Remote I/O error"):
        bus.write(0x33, b"\x00")  # nobody has this address
    bus.close()


def test_an_unplugged_bus_is_named_and_comes_back(robot):
    name = str(robot.parameters()["imu"]["bus"])
    bus = SocketI2c(name)
    robot.faults["imu unplug"]()
    with pytest.raises(TransportError):
        bus.read(IMU_ADDRESS, 4)
    with pytest.raises(PortUnavailable, match="start the fake robot"):
        SocketI2c(name)
    robot.mend()
    assert len(SocketI2c(name).read(IMU_ADDRESS, 4)) == 4


def jpeg(grey: int) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((120, 160, 3), grey, np.uint8))[1])


def test_pictures_come_through_the_camera_driver_with_the_time_of_their_exposure(robot):
    name = str(robot.parameters()["camera"]["device"])
    settings = CameraSettings(device=name, width=160, height=120)
    camera = UsbCamera(settings, lambda: SocketCamera(name))
    camera.connect()
    pictures = []

    def step() -> bool:
        robot.camera.show(jpeg(100 + len(pictures)), time.monotonic() - 0.05)
        cycle = camera.step()
        pictures.extend([cycle.picture] if cycle.picture else [])
        return len(pictures) >= 3

    assert wait_until(step, TIMEOUT_S)
    assert pictures[0].jpeg == jpeg(100)
    assert (pictures[0].width, pictures[0].height) == (160, 120)
    assert 0.05 <= time.monotonic() - pictures[-1].time_s < 5.0
    robot.faults["camera unplug"]()
    assert camera.step().picture is None
    robot.mend()
    assert (robot.folder / "camera").exists()
    camera.close()


def test_the_rudders_pulses_are_its_angle(robot):
    settings = RudderSettings(chip=str(robot.parameters()["rudder"]["chip"]))
    driver = RudderDriver(settings, lambda: open_output(settings), sleep=lambda _: None)
    driver.connect()

    def step() -> bool:
        driver.armed(True)
        driver.command(0.4)
        driver.step()
        time.sleep(0.01)
        return robot.rudder_angle() == pytest.approx(0.4, abs=1e-3)

    assert wait_until(step, TIMEOUT_S)
    driver.close()


def test_an_unplugged_rotor_coasts_by_its_own_watchdog_and_is_plugged_again(robot):
    port = robot.folder / "rotor"
    robot.rotor.mode, robot.rotor.commanded = 4, 50.0
    assert wait_until(lambda: robot.rotor_speed() > 25.0, TIMEOUT_S)
    robot.faults["rotor unplug"]()
    assert not port.is_symlink()
    assert wait_until(lambda: abs(robot.rotor_speed()) < 0.1, TIMEOUT_S)
    robot.mend()
    SerialPort(str(port), 115200).close()


def test_a_fake_robot_alone_can_be_armed(robot):
    said = robot.parameters()["rotor"]
    settings = RotorSettings(port=str(said["port"]), battery_cells=int(said["battery_cells"]))
    watch = RotorWatch(settings)
    stream = SerialPort(settings.port, 115200)
    vertiq = Vertiq(stream, reply_timeout_s=0.2)
    end = time.monotonic() + 0.6
    while time.monotonic() < end:
        watch.ask(vertiq, time.monotonic())
    stream.close()
    assert math.isfinite(watch.judge.filtered_volts)
    assert watch.health.stops == watch.health.warnings == ()


def test_every_fault_can_be_made_and_mended(robot):
    for name, make in robot.faults.items():
        make()
        robot.mend()
        assert (robot.folder / "rotor").is_symlink(), name
        assert robot.imu.alter(felt(0.0)) == felt(0.0), name
        assert robot.bus.fault() is None, name
        assert not robot.camera.frozen, name


def test_a_camera_waits_for_no_driver_and_shows_it_the_newest_picture(robot):
    name = str(robot.parameters()["camera"]["device"])
    source = SocketCamera(name)
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    large = bytes(cv2.imencode(".png", noise)[1])  # more than a socket holds
    for k in range(20):  # a driver that does not read would stop one that waits for it
        robot.camera.show(large, float(k))
    robot.camera.show(jpeg(50), 99.0)
    frames = []

    def newest() -> bool:
        frame = source.read()
        frames.extend([frame] if frame else [])
        return bool(frames) and frames[-1].time_s == 99.0

    assert wait_until(newest, TIMEOUT_S)
    assert frames[-1].jpeg == jpeg(50)
    source.close()


def test_a_rotor_whose_answers_nobody_reads_obeys_its_own_watchdog(robot):
    port = SerialPort(str(robot.parameters()["rotor"]["port"]), 115200)
    port.write(encode(iquart.CTRL_VELOCITY.set(0, 50.0)))
    assert wait_until(lambda: robot.rotor_speed() > 40.0, TIMEOUT_S)
    questions = b"".join(encode(iquart.TELEMETRY.get(0)) for _ in range(100))
    for _ in range(20):  # 46 kB of answers
        port.write(questions)
    assert wait_until(lambda: robot.rotor_speed() < 1.0, TIMEOUT_S)
    assert robot.rotor.timeouts == 1
    port.close()


def test_devices_and_drivers_live_in_simulated_time(tmp_path):
    """Time stands still on the wall clock's account, and the rotor with it."""
    now = [1000.0]
    robot = FakeRobot(tmp_path / "slow", RudderSettings(), clock=lambda: now[0])
    vertiq = Vertiq(
        SerialPort(str(robot.parameters()["rotor"]["port"]), 115200),
        reply_timeout_s=TIMEOUT_S,
        clock=lambda: now[0],
    )
    sample = vertiq.drive(50.0)
    assert sample is not None
    assert (sample.time_s, sample.velocity) == (1000.0, 0.0)
    now[0] += 0.05
    sample = vertiq.drive(50.0)
    assert sample is not None
    assert sample.velocity == pytest.approx(50.0, rel=0.01)
    assert sample.angle == pytest.approx(2.5, rel=0.02)
    robot.close()
