# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lost devices, faults and stops.

When a lost device is tried again; the device's thread on a clock that others move; faults and stop causes of a whole robot on
one simulated clock; the command that makes the robot safe after a node was killed; the fake robot's devices through the real
drivers, where every fault can be mended.
"""

import errno
import itertools
import math
import os
import struct
import threading
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from fakes import wait_until

from fish_hw import safe_stop
from fish_hw.devices.imu_driver import ImuDriver
from fish_hw.devices.reconnect import Link, Loss
from fish_hw.devices.rotor_watch import RotorWatch
from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.devices.usb_camera import UsbCamera
from fish_hw.devices.vertiq import Vertiq
from fish_hw.emulators.bno085 import FedBno085, Felt
from fish_hw.emulators.fake_robot import IMU_ADDRESS, FakeRobot
from fish_hw.emulators.fault_run import RAMP_S, FaultRun, moved_while_disarmed, speed_changes
from fish_hw.emulators.lockstep_rotor import DT, SETTINGS, LockstepRotor
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.emulators.stop_causes import CAUSES, limit_s, stop
from fish_hw.emulators.vertiq import VELOCITY_MODE, VertiqEmulator
from fish_hw.nodes.worker import Worker
from fish_hw.protocol import iquart, sh2
from fish_hw.protocol.iquart import encode
from fish_hw.safe_stop import main
from fish_hw.settings import CameraSettings, ImuSettings, RotorSettings, RudderSettings
from fish_hw.transport.interfaces import PortUnavailable, TransportError
from fish_hw.transport.serial_port import SerialPort
from fish_hw.transport.sysfs_pwm import SysfsPwm
from fish_hw.transport.unix_socket import SocketCamera, SocketI2c
from fish_node.parameter_file import read_settings

PERIOD_S, TIMEOUT_S = 0.01, 15.0

# a module that restarts into a fault, and faults that the robot swims through
BEARABLE = {"computer stalls", "imu errors", "imu bits", "imu reset", "rotor garbage"}

UNNAMED = ("SIGTERM to node rotor", "SIGKILL to node rotor")  # nobody is left to say it

TURNED = (0.0, 0.0, math.sin(0.4), math.cos(0.4))


def failed_attempts(link: Link, start: float, duration_s: float) -> list[float]:
    """Times at which a device that stays away is tried, looked at every 10 ms."""
    times = []
    for i in range(round(duration_s / 0.01)):
        now = start + 0.01 * i
        if link.due(now):
            times.append(now)
            link.lose("gone", now)
    return times


def waits(times: list[float]) -> list[float]:
    return [b - a for a, b in itertools.pairwise(times)]


def test_waits_double_up_to_the_longest_and_start_again_after_data() -> None:
    link = Link("device")
    first = failed_attempts(link, 100.0, 25.0)
    assert first[0] == 100.0  # at once
    assert waits(first) == pytest.approx([0.5, 1.0, 2.0, 4.0, 5.0, 5.0, 5.0], abs=0.011)
    assert link.attempts == len(first)
    link.works()
    assert waits(failed_attempts(link, 200.0, 4.0)) == pytest.approx([0.5, 1.0, 2.0], abs=0.011)


def test_a_reason_is_said_when_it_is_new_and_the_return_once() -> None:
    link = Link("device")
    assert link.works() == []  # it was never away
    events = [*link.lose("gone", 0.0), *link.lose("gone", 1.0), *link.lose("busy", 2.0)]
    assert events == ["gone", "busy"]
    assert all(isinstance(event, Loss) for event in events)
    assert link.trouble == "busy"
    assert [*link.works(), *link.works()] == ["device connected again"]
    assert link.lose("busy", 3.0) == ["busy"]  # a second loss is news though its reason is not


def test_steps_come_by_the_clock_that_it_is_given_and_not_by_the_wall_clocks():
    now = [0.0]
    stepped = threading.Semaphore(0)
    times: list[float] = []

    def step() -> None:
        times.append(now[0])
        stepped.release()

    worker = Worker(step, PERIOD_S, lambda: None, lambda: now[0], lambda _: 1e-3)
    worker.start()
    for k in range(1, 11):
        assert stepped.acquire(timeout=TIMEOUT_S)
        now[0] = k * PERIOD_S + 1e-6
    assert stepped.acquire(timeout=TIMEOUT_S)
    assert not stepped.acquire(timeout=0.1)  # the clock stands still
    worker.stop(TIMEOUT_S)
    assert len(times) == 11
    assert all(abs(time - k * PERIOD_S) < 1e-3 for k, time in enumerate(times))


def test_after_every_fault_the_robot_swims_again_when_it_is_armed(tmp_path):
    run = FaultRun(tmp_path)
    for name in sorted(run.robot.faults):
        run.fault(name)
    counts = run.counts
    assert set(counts.done) == set(run.robot.faults)
    assert set(counts.done) - set(counts.disarmed) <= BEARABLE
    assert (counts.crashes, counts.not_recovered) == ([], [])
    assert (counts.moved_disarmed, counts.over_limits) == (0, 0)


def test_a_driver_that_raises_and_one_that_drives_disarmed_are_counted(tmp_path):
    run = FaultRun(tmp_path)
    run.robot.faults["mistake"] = lambda: setattr(run.robot, "speed", lambda _: 1 / 0)
    run.fault("mistake")
    assert "ZeroDivisionError" in run.counts.crashes[0]


@pytest.mark.parametrize(("late_s", "count"), [(RAMP_S - 0.01, 0), (RAMP_S + 0.01, 1)])
def test_motion_after_the_ramp_of_a_disarmed_robot_is_counted(late_s, count):
    states = [(0.0, True), (1.0, False), (1.1, False), (2.0, True)]
    sent = [(0.5, 50.0), (1.0 + late_s, 3.0), (1.9, 0.0), (2.1, 20.0)]
    assert moved_while_disarmed(states, sent) == count


def test_a_command_after_a_silence_starts_from_rest():
    sent = [(0.0, 10.0), (0.01, 30.0), (0.02, -5.0), (2.0, -12.0)]
    assert speed_changes(sent) == [20.0, 0.0, 12.0]


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_stops_the_rotor_in_time_and_names_itself(cause):
    for seed in range(2):
        one = stop(cause, seed)
        assert one.last_command_s <= limit_s(cause)
        assert one.coasting_s <= limit_s(cause) + 0.05
        assert bool(one.reason) == (cause not in UNNAMED)


def swimming() -> LockstepRotor:
    robot = LockstepRotor()
    robot.driver.connect()
    robot.run(1.0)
    assert robot.arm() == ""
    robot.run(1.3)
    return robot


def moved(robot: LockstepRotor, since: float) -> bool:
    return any(v != 0.0 for t, v in robot.module.commanded_at if t > since)


@pytest.mark.parametrize("back", ["camera/pose", "joint_command", "odometry/filtered"])
def test_what_is_back_does_not_start_the_rotor(back):
    robot = swimming()
    robot.silent.add(back)
    robot.run(1.0)
    robot.silent.clear()
    stopped = robot.clock.now
    robot.run(3.0)
    assert not moved(robot, stopped)
    assert robot.arm() == ""
    robot.run(0.5)
    assert moved(robot, stopped)


def test_no_jump_of_the_command_over_a_lost_port_and_late_cycles():
    robot = swimming()
    for _ in range(3):
        robot.line.unplugged = True
        robot.run(0.8)
        robot.line.unplugged = False
        robot.run(2.0)
        assert robot.arm() == ""
        robot.run(1.0)
        robot.clock.now += 0.12  # the computer stalls
        robot.run(0.5)
    sent = robot.module.commanded_at
    assert len(sent) > 300
    most = SETTINGS.max_acceleration * 1.5 * DT + 1e-6
    jumps = [
        (a, b)
        for a, b in itertools.pairwise(sent)
        if abs(b[1] - a[1]) > most and abs(b[1]) > abs(a[1])
    ]
    assert jumps == []


def parameter_file(path, **parameters):
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
    return path


def test_both_are_stopped(tmp_path, vertiq_emulator):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    for name, text in (("period", "20000000"), ("duty_cycle", "1900000"), ("enable", "1")):
        (chip.channel / name).write_text(text)
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert vertiq_emulator.timeouts == 0
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)


def test_the_module_of_the_file_is_stopped(tmp_path):
    emulator = VertiqEmulator(module=5)
    emulator.written[iquart.TIMEOUT.type, iquart.TIMEOUT.param] = struct.pack(
        "<f", 60.0
    )  # not by its own watchdog
    emulator.mode, emulator.commanded = VELOCITY_MODE, 50.0
    try:
        rotor = parameter_file(tmp_path / "rotor.yaml", port=emulator.port, module_id=5)
        assert main(["--rotor", str(rotor)]) == 0
        assert wait_until(lambda: emulator.mode == iquart.COAST)
        assert emulator.timeouts == 0
    finally:
        emulator.close()


def test_the_device_is_stopped_that_the_node_drives(tmp_path, capsys):
    """The node's own values, further down in the file, had not been read: another servo was centred, with success."""
    chips = [rudder_at_the_side(tmp_path / str(k)) for k in range(2)]
    rudder = tmp_path / "rudder.yaml"
    values = [{"ros__parameters": {"chip": str(chip.chip), "max_rate": 50.0}} for chip in chips]
    rudder.write_text(yaml.safe_dump({"/**": values[0], "/fish/rudder": values[1]}))
    assert main(["--rudder", str(rudder)]) == 0
    assert [(chip.read("duty_cycle"), chip.read("enable")) for chip in chips] == [
        (1_900_000, 1),
        (1_500_000, 0),
    ]
    rudder.write_text(
        yaml.safe_dump({"/red/fish/rudder": values[0], "/blue/fish/rudder": values[1]})
    )
    assert main(["--rudder", str(rudder)]) == 1
    assert chips[0].read("enable") == 1
    assert "does not read /blue/fish/rudder, /red/fish/rudder" in capsys.readouterr().err


@pytest.mark.parametrize("step", ["set_pulse_ns", "stop"])
def test_pulses_that_cannot_be_switched_off_are_a_failure(tmp_path, capsys, monkeypatch, step):
    def refuse(*_):
        raise TransportError("cannot write 0 to enable")

    monkeypatch.setattr(SysfsPwm, step, refuse)
    chip = rudder_at_the_side(tmp_path)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), max_rate=50.0)
    assert main(["--rudder", str(rudder)]) == 1
    assert chip.read("enable") == 1
    assert capsys.readouterr().err == "safe_stop: rudder: cannot write 0 to enable\n"


def test_rudder_is_centred_though_the_rotor_is_gone(tmp_path, capsys):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    rotor = parameter_file(tmp_path / "rotor.yaml", port="/dev/ttyX9")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), off_at_exit=False)
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 1)
    assert "safe_stop: rotor: cannot open serial port /dev/ttyX9" in capsys.readouterr().err


def rudder_at_the_side(tmp_path) -> PwmChipEmulator:
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    for name, text in (("period", "20000000"), ("duty_cycle", "1900000"), ("enable", "1")):
        (chip.channel / name).write_text(text)
    return chip


@pytest.mark.parametrize("wrong", [{"module_id": 0.0}, {"baud": "fast"}, {"port": 7}])
def test_a_mistake_in_the_rotors_file_does_not_leave_the_rudder(tmp_path, capsys, wrong):
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", **wrong)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)
    error = capsys.readouterr().err
    assert f"{next(iter(wrong))} is" in error
    assert error.count("\n") == 1


def test_a_wrong_value_that_a_stop_does_not_need_keeps_nothing_from_being_stopped(
    tmp_path, vertiq_emulator
):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = rudder_at_the_side(tmp_path / "side")
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port, battery_cells=40)
    wrong = {"armed_timeout_s": 9.0, "stale_s": "fast"}
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), **wrong)
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)


def test_what_nobody_expects_does_not_leave_the_rudder(tmp_path, capsys, monkeypatch):
    chip = rudder_at_the_side(tmp_path)
    monkeypatch.setattr(safe_stop, "SerialPort", lambda *_: 1 / 0)
    rotor = parameter_file(tmp_path / "rotor.yaml")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert chip.read("enable") == 0
    assert capsys.readouterr().err == "safe_stop: rotor: ZeroDivisionError('division by zero')\n"


def test_the_servo_gets_time_to_travel_before_the_pulses_end(tmp_path):
    """From one stop to the other, since the angle before is not known."""
    chip = rudder_at_the_side(tmp_path)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), max_rate=8.0)
    start = time.monotonic()
    assert main(["--rudder", str(rudder)]) == 0
    assert time.monotonic() - start >= 2 * 0.8 / 8.0


def test_emulated_devices_leave_the_real_ones_alone(tmp_path):
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", port="emulator")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), backend="emulator")
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_900_000, 1)
    with pytest.raises(ValueError, match="no output to open"):
        open_output(RudderSettings(backend="emulator"))


def test_nothing_named(capsys):
    with pytest.raises(SystemExit, match="2"):
        main([])
    assert "nothing to stop" in capsys.readouterr().err


def test_unknown_parameters_are_said_but_the_robot_is_stopped(tmp_path, capsys, vertiq_emulator):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port, use_sim_time=True)
    rudder = parameter_file(
        tmp_path / "rudder.yaml", chip=str(chip.chip), chanel=1, **{"qos_overrides.x": 1}
    )
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)
    error = capsys.readouterr().err
    assert error.startswith(
        f"safe_stop: rudder: {rudder}: unknown parameter chanel (did you mean channel?); known: "
    )
    assert error.count("\n") == 1


def test_names_that_are_no_words_are_left_out(tmp_path):
    path, said = tmp_path / "rudder.yaml", []
    path.write_text("/**: {ros__parameters: {1: 1, false: 2, channel: 3}}")
    assert read_settings(path, "/fish/rudder", RudderSettings, said.append).channel == 3
    assert len(said) == 1
    assert "unknown parameter 1, False; known: " in said[0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{bad: [", "while parsing"),
        ("[]", "expected a node name with ros__parameters"),
        ("/fish/rotor: {ros__parameters: {module_id: 3}}", "nothing for the node /fish/rudder"),
        (
            "/red/fish/rudder: {ros__parameters: {}}\n/fish/rudder: {ros__parameters: {}}",
            "of one robot only",
        ),
        ("/**: {ros__parameters: {pwm_hz: 3}}", "pwm_hz is 3.0, expected 40.0 to 333.0"),
        ("/**: {ros__parameters: {pwm_hz: fast}}", "pwm_hz is 'fast', expected float such as 50.0"),
        ("/**: {ros__parameters: {channel: 0.0}}", "channel is 0.0, expected int such as 0"),
    ],
)
def test_parameter_file_errors_name_file_and_field(tmp_path, text, expected):
    path = tmp_path / "rudder.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"rudder\.yaml") as caught:
        read_settings(path, "/fish/rudder", RudderSettings, pytest.fail)
    assert expected in str(caught.value)


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


@pytest.mark.parametrize(
    ("rate", "measured"),
    [(math.nan, []), (math.inf, []), (100.0, [0x7FFF / 512]), (-100.0, [-0x8000 / 512])],
)
def test_the_emulated_imu_measures_what_its_registers_hold(rate, measured):
    hub = FedBno085(lambda: 10.0)
    hub.write(bytes([21, 0, sh2.CONTROL, 0]) + sh2.set_feature(sh2.GYROSCOPE, 10_000))
    assert len(hub.read(100)) == 100  # the answer to that
    hub.feel(replace(felt(10.0), angular_velocity=(0.0, 0.0, rate)))
    data = hub.read(100)
    raw = struct.unpack_from("<h", data, sh2.HEADER_BYTES + 5 + 8)[0]  # header, base, report, z
    assert ([raw / 512] if any(data) else []) == measured  # Q9


def test_a_bus_outlives_what_a_driver_should_not_send(robot, capfd):
    name = str(robot.parameters()["imu"]["bus"])
    with pytest.raises(TransportError):
        SocketI2c(name).write(IMU_ADDRESS, b"\0")  # no packet
    assert len(SocketI2c(name).read(IMU_ADDRESS, 4)) == 4
    assert "IndexError" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("volts", "answered"), [(math.nan, 0.0), (1e6, 327.67), (-math.inf, -327.68)]
)
def test_the_emulated_module_answers_whatever_its_voltage_is(robot, volts, answered):
    port = SerialPort(str(robot.parameters()["rotor"]["port"]), 115200)
    vertiq = Vertiq(port, reply_timeout_s=0.2)
    robot.rotor.volts = volts
    assert wait_until(lambda: vertiq.power().volts == pytest.approx(answered), TIMEOUT_S)
    port.close()


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
    source = SocketCamera(name, lambda time_s: time_s + 5.0)
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    large = bytes(cv2.imencode(".png", noise)[1])  # more than a socket holds
    for k in range(20):  # a driver that does not read would stop one that waits for it
        robot.camera.show(large, float(k))
    robot.camera.show(jpeg(50), 99.0)
    frames = []

    def newest() -> bool:
        frame = source.read()
        frames.extend([frame] if frame else [])
        return bool(frames) and frames[-1].time_s == 99.0 + 5.0  # on its own clock

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
