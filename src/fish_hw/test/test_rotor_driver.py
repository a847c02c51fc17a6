# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The whole rotor driver on a real port with the emulated module behind it, in real time."""

import itertools
import math
import statistics
import struct
import termios
import time
from dataclasses import replace

import pytest
from fakes import wait_until

from fish_hw.devices import vertiq_search
from fish_hw.devices.leak_sensor import LeakSensor
from fish_hw.devices.reconnect import ERROR, OK, WARN, DeviceError, Loss
from fish_hw.devices.rotor_driver import RotorDriver
from fish_hw.devices.rotor_guard import Phase
from fish_hw.emulators.vertiq import VELOCITY_MODE, VertiqEmulator
from fish_hw.protocol import iquart
from fish_hw.protocol.iquart import GET
from fish_hw.settings import RotorSettings
from fish_hw.transport.interfaces import PortUnavailable
from fish_hw.transport.serial_port import SerialPort

# generous times: a loaded machine keeps the emulator waiting, and that is not what is tested here
SETTINGS = RotorSettings(
    port="test",
    estimate="ignored",
    rudder_timeout_s=0.0,
    reply_timeout_s=0.2,
    stale_s=0.4,
    module_timeout_s=0.5,
    telemetry_timeout_s=1.0,
)
DT = 0.01


class Bench:
    """A driver on an emulator; run() steps it in real time."""

    def __init__(self, emulator: VertiqEmulator, settings: RotorSettings = SETTINGS) -> None:
        self.emulator = emulator
        self.driver = RotorDriver(settings, lambda: SerialPort(self.emulator.port, 115200))
        self.samples, self.events, self.telemetry = [], [], []

    def connect(self) -> None:
        """Connect, in the second or third try if the emulator's thread is kept waiting."""
        assert self.run(15.0, until=lambda: self.driver.connected)

    def run(self, duration_s: float, command=None, until=None, arm: bool = True) -> bool:
        """With a command, the operator arms as often as it may be armed; with arm=False nobody does."""
        start = time.monotonic()
        while time.monotonic() - start < duration_s:
            if command is not None:
                self.driver.command(command(time.monotonic() - start))
                if arm and not self.driver.arming.armed:
                    self.driver.arming.arm(time.monotonic())
            cycle = self.driver.step()
            self.events += cycle.events
            self.samples += [cycle.sample] if cycle.sample else []
            self.telemetry += [cycle.telemetry] if cycle.telemetry and cycle.telemetry.volts else []
            if until is not None and until():
                return True
            time.sleep(DT)
        return until is None


@pytest.fixture
def bench(vertiq_emulator):
    bench = Bench(vertiq_emulator)
    bench.connect()
    yield bench
    bench.driver.close()


def oscillation(t: float) -> float:
    return 9.0 * 4 * math.pi * math.sin(4 * math.pi * t)


def steady(_t: float) -> float:
    return 60.0


def test_a_driver_that_stood_still_until_the_module_coasted_is_disarmed(bench):
    """Commands go on meanwhile: the thread of the device alone waits, as for a blocked write."""
    running = lambda: bench.emulator.mode == VELOCITY_MODE  # noqa: E731
    assert bench.run(20.0, steady, until=running)
    end = time.monotonic() + SETTINGS.module_timeout_s + 0.1
    while time.monotonic() < end:
        bench.driver.command(60.0)
        time.sleep(DT)
    bench.run(0.2, steady, arm=False)
    assert bench.driver.arming.reason == "no rotor module for 0.5 s"
    assert bench.emulator.mode == iquart.COAST


def test_oscillation_is_followed_and_measured(bench):
    def speeds():
        return [s.velocity for s in bench.samples]

    def both_ways():
        return max(speeds(), default=0.0) > 80.0 and min(speeds(), default=0.0) < -80.0

    assert bench.run(30.0, oscillation, until=both_ways)
    times = [s.time_s for s in bench.samples]
    assert times == sorted(times)
    assert bench.driver.status().level == OK
    assert bench.telemetry[0].volts == pytest.approx(14.8)


def test_measured_angle_is_the_integral_of_measured_speed(bench):
    """In the median of fifty pairs of samples: a loaded machine stamps some of them late."""

    def slopes():
        pairs = itertools.pairwise(
            s for s in bench.samples if s.velocity == pytest.approx(60.0, abs=1.0)
        )
        return [
            (b.angle - a.angle) / (b.time_s - a.time_s) for a, b in pairs if b.time_s > a.time_s
        ]

    assert bench.run(30.0, steady, until=lambda: len(slopes()) >= 50)
    assert statistics.median(slopes()) == pytest.approx(60.0, rel=0.1)


def test_a_mirrored_module_turns_the_other_way_until_it_stands():
    emulator = VertiqEmulator(module=3)
    bench = Bench(emulator, replace(SETTINGS, module_id=3, sign=-1, ramp_s=0.1))
    try:
        bench.connect()
        assert bench.run(15.0, steady, until=lambda: emulator.commanded == -60.0)
        assert bench.run(
            15.0,
            steady,
            until=lambda: any(s.velocity == pytest.approx(60.0, abs=1.0) for s in bench.samples),
        )
        orders = len(emulator.log)
        assert bench.run(15.0, until=lambda: bench.driver.guard.phase is Phase.COASTING)
        assert wait_until(lambda: emulator.mode == iquart.COAST)
        ordered = [
            struct.unpack("<f", m.data)[0]
            for m in emulator.log[orders:]
            if m.param == iquart.CTRL_VELOCITY.param
        ]
        assert ordered
        assert max(ordered) < 0.0
    finally:
        bench.driver.close()
        emulator.close()


def test_stale_command_coasts_without_polling(bench):
    bench.run(0.4, steady)
    assert bench.run(15.0, until=lambda: bench.driver.guard.phase is Phase.COASTING)
    asked = sum(m.access == GET for m in bench.emulator.log)
    bench.run(0.2)
    assert sum(m.access == GET for m in bench.emulator.log) == asked
    assert bench.emulator.mode == iquart.COAST
    assert bench.emulator.timeouts == 0
    assert bench.driver.status().level == WARN
    assert any("no joint_command for 0.4 s" in event for event in bench.events)


def test_module_stops_by_itself_if_coast_is_lost(bench):
    """The trap: polling feeds the module's watchdog. The driver is silent, so it can fire."""
    bench.run(0.3, steady)
    bench.driver._vertiq.coast = lambda: None
    assert bench.run(15.0, until=lambda: bench.emulator.timeouts == 1)
    assert bench.emulator.mode == iquart.COAST


def test_module_that_was_left_driving_coasts_from_the_start(vertiq_emulator):
    """As after a node that was killed and is back before the module's own watchdog fires."""
    vertiq_emulator.written[iquart.TIMEOUT.type, iquart.TIMEOUT.param] = struct.pack("<f", 60.0)
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    bench = Bench(vertiq_emulator)
    bench.connect()
    assert vertiq_emulator.mode == iquart.COAST
    assert vertiq_emulator.timeouts == 0
    bench.driver.close()


def test_module_that_drives_on_its_own_is_told_to_coast(bench):
    bench.emulator.mode, bench.emulator.commanded = VELOCITY_MODE, 50.0
    assert bench.run(15.0, until=lambda: any("drove although" in e for e in bench.events))
    assert bench.run(15.0, until=lambda: bench.emulator.mode == iquart.COAST)


def test_module_that_does_not_say_its_mode_is_not_accused(vertiq_emulator):
    vertiq_emulator.mangle = lambda reply: b"" if reply[2:4] == bytes([52, 0]) else reply
    bench = Bench(vertiq_emulator, replace(SETTINGS, reply_timeout_s=0.05))
    bench.connect()
    assert bench.run(15.0, until=lambda: len(bench.telemetry) >= 2)
    assert not any("drove" in e for e in bench.events)
    bench.driver.close()


def test_restarted_module_is_set_up_again_before_it_moves(bench):
    bench.emulator._booted -= 100.0
    bench.run(0.5, steady)
    bench.emulator.reboot()
    assert bench.emulator.timeout_s == 1.0
    assert bench.run(15.0, steady, until=lambda: any("restarted" in e for e in bench.events))
    assert bench.emulator.timeout_s == SETTINGS.module_timeout_s
    assert bench.emulator.mode == iquart.COAST


def test_unplugged_then_plugged_again(bench):
    bench.run(0.2, steady)
    bench.emulator.close()
    assert bench.run(15.0, steady, until=lambda: not bench.driver.connected)
    assert bench.driver.status().level == ERROR
    assert not bench.driver.arming.armed
    assert bench.driver.guard.phase is Phase.COASTING
    said = len(bench.events)
    bench.run(0.3, steady)
    assert len(bench.events) == said  # not once per cycle
    bench.emulator = VertiqEmulator()
    try:
        assert bench.run(15.0, steady, until=lambda: bench.driver.connected, arm=False)
        bench.run(1.0, steady, arm=False)
        assert bench.emulator.mode == iquart.COAST  # it is back, and nobody armed it
        assert bench.run(15.0, steady, until=lambda: bench.emulator.mode == VELOCITY_MODE)
    finally:
        bench.driver.close()
        bench.emulator.close()


def test_silent_module_is_lost_and_found(bench):
    bench.emulator.mangle = lambda _: b""
    bench.driver._vertiq._reply_timeout_s = 0.02  # no need to wait long for what will not come
    assert bench.run(15.0, steady, until=lambda: not bench.driver.connected)
    assert "stopped answering" in bench.driver.status().message
    bench.emulator.mangle = lambda reply: reply
    assert bench.run(15.0, until=lambda: bench.driver.connected)


def test_low_battery_stops_and_stays_stopped(vertiq_emulator):
    bench = Bench(vertiq_emulator, replace(SETTINGS, battery_filter_s=0.0))
    bench.connect()
    assert bench.run(15.0, steady, until=lambda: bench.emulator.mode == VELOCITY_MODE)
    bench.emulator.volts = 4 * 3.2
    assert bench.run(15.0, steady, until=lambda: bench.driver.guard.phase is Phase.COASTING)
    said = "battery at 3.20 V per cell"
    assert said in bench.driver.arming.reason
    driven = sum(m == iquart.CTRL_VELOCITY.set(0, 60.0) for m in bench.emulator.log)
    assert bench.run(15.0, steady, until=lambda: bench.driver.guard.phase is Phase.RESTING)
    bench.run(0.3, steady)  # the operator tries to arm all the time
    assert sum(m == iquart.CTRL_VELOCITY.set(0, 60.0) for m in bench.emulator.log) == driven
    assert said in bench.driver.status().message
    bench.emulator.volts = 4 * 3.8
    bench.run(1.0, steady, arm=False)
    assert bench.emulator.mode == iquart.COAST  # a battery that recovered arms nothing
    assert bench.run(15.0, steady, until=lambda: bench.emulator.mode == VELOCITY_MODE)
    bench.driver.close()


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_a_command_that_is_no_number_disarms(bench, speed):
    assert bench.run(15.0, steady, until=lambda: bench.emulator.mode == VELOCITY_MODE)
    bench.driver.command(speed)
    assert bench.run(15.0, steady, arm=False, until=lambda: bench.emulator.mode == iquart.COAST)
    assert f"commanded speed is {speed}" in bench.driver.arming.reason


def test_a_jammed_rotor_disarms(bench):
    assert bench.run(15.0, oscillation, until=lambda: abs(bench.emulator.velocity) > 50.0)
    bench.emulator.jammed = True
    assert bench.run(15.0, oscillation, arm=False, until=lambda: not bench.driver.arming.armed)
    assert "jammed" in bench.driver.arming.reason or "stuck" in bench.driver.arming.reason


class Wire:
    """A GPIO line that a test pulls low."""

    low = False

    def wait(self, timeout_s: float) -> None:
        del timeout_s

    def is_low(self) -> bool:
        return self.low

    def close(self) -> None:
        """Nothing to give back."""


def test_water_in_the_hull_disarms_and_forbids_to_arm(vertiq_emulator):
    wire = Wire()
    driver = RotorDriver(
        SETTINGS,
        lambda: SerialPort(vertiq_emulator.port, 115200),
        leak=LeakSensor(lambda: wire, wet_is_low=True),
    )
    bench = Bench(vertiq_emulator)
    bench.driver = driver
    bench.connect()
    assert bench.run(15.0, steady, until=lambda: vertiq_emulator.mode == VELOCITY_MODE)
    wire.low = True
    assert bench.run(15.0, steady, until=lambda: vertiq_emulator.mode == iquart.COAST)
    assert driver.arming.reason == "leak: water in the hull"
    assert "leak" in driver.arming.arm(time.monotonic())
    assert driver.status().message.startswith("leak: water in the hull")  # whatever disarmed it
    driver.close()


def test_protection_works_without_the_derate_register(vertiq_emulator):
    """Some firmware lacks it; nothing else depends on it."""
    vertiq_emulator.mangle = lambda reply: b"" if reply[2:4] == bytes([50, 41]) else reply
    bench = Bench(vertiq_emulator, replace(SETTINGS, battery_filter_s=0.0, reply_timeout_s=0.05))
    bench.connect()
    vertiq_emulator.faults = 0x40
    assert bench.run(15.0, steady, until=lambda: "coil temperature" in bench.driver.arming.reason)
    assert bench.driver.status().level == ERROR
    bench.driver.close()


def test_missing_telemetry_is_an_error(vertiq_emulator):
    vertiq_emulator.mangle = lambda reply: b"" if reply[2:4] == bytes([88, 1]) else reply
    bench = Bench(vertiq_emulator, replace(SETTINGS, reply_timeout_s=0.05))
    bench.connect()
    said = "no telemetry: battery and temperature not answered"
    assert bench.run(15.0, steady, until=lambda: bench.driver.status().message == said)
    assert bench.driver.status().level == ERROR
    vertiq_emulator.mangle = lambda reply: reply
    assert bench.run(15.0, steady, until=lambda: bench.driver.status().level == OK)
    bench.driver.close()


def test_clearing_faults_does_not_break_the_silence_of_a_stop(bench):
    assert bench.run(15.0, steady, until=lambda: bench.emulator.mode == VELOCITY_MODE)
    assert bench.run(15.0, until=lambda: bench.driver.guard.phase is Phase.COASTING)
    bench.emulator.faults_ever = 0b10
    bench.driver.clear_faults()
    asked = sum(m.type == iquart.FAULT_EVER.type for m in bench.emulator.log)
    while bench.driver.guard.phase is Phase.COASTING:
        assert sum(m.type == iquart.FAULT_EVER.type for m in bench.emulator.log) == asked
        bench.run(DT)
    assert bench.run(15.0, until=lambda: any("it held: input voltage" in e for e in bench.events))


def test_module_that_answers_no_measurement_is_lost_once(bench):
    """It can be set up each time, so that it seems to be found."""
    silent = (bytes([50, 12]), bytes([50, 13]))
    bench.emulator.mangle = lambda reply: b"" if reply[2:4] in silent else reply
    assert bench.run(15.0, until=lambda: any(isinstance(e, Loss) for e in bench.events))
    lost = bench.driver._link.attempts
    assert bench.run(30.0, until=lambda: bench.driver._link.attempts > lost)
    said = [e for e in bench.events if isinstance(e, Loss) and "stopped answering" in e]
    assert len(said) == 1
    assert "rotor connected again" not in bench.events
    bench.emulator.mangle = lambda reply: reply
    assert bench.run(15.0, until=lambda: bench.events[-1] == "rotor connected again")


def test_faults_are_named_before_they_are_cleared(bench):
    bench.emulator.faults_ever = 0b110
    bench.driver.clear_faults()
    assert bench.run(
        2.0,
        until=lambda: any("it held: input voltage, reference voltage" in e for e in bench.events),
    )


def test_close_coasts(bench):
    bench.run(0.3, steady)
    assert bench.emulator.mode == VELOCITY_MODE
    bench.driver.close()
    assert wait_until(lambda: bench.emulator.mode == iquart.COAST)
    assert bench.emulator.timeouts == 0


def test_port_that_is_absent(vertiq_emulator):
    driver = RotorDriver(SETTINGS, lambda: SerialPort("/dev/no_such_port", 115200))
    with pytest.raises(
        PortUnavailable, match="cannot open serial port /dev/no_such_port: there is no such port"
    ):
        driver.connect()
    assert driver.status().level == ERROR


def complaint(emulator: VertiqEmulator, **settings) -> str:
    """What a driver says of a module that does not answer."""
    changed = replace(SETTINGS, reply_timeout_s=0.01, **settings)

    def open_at(baud: int) -> SerialPort:
        return SerialPort(emulator.port, baud)

    driver = RotorDriver(changed, lambda: open_at(changed.baud), open_at=open_at)
    with pytest.raises(DeviceError, match=r"test: no Vertiq module \d answers") as caught:
        driver.connect()
    SerialPort(emulator.port, 115200).close()  # the port was given back
    return str(caught.value)


def test_a_wrong_module_id_is_told(vertiq_emulator):
    said = complaint(vertiq_emulator, module_id=7)
    assert "module 0 answers there: set module_id" in said


def test_a_wrong_baud_rate_is_told():
    emulator = VertiqEmulator(speed=termios.B921600)
    try:
        assert "module 0 answers at 921600 baud: set baud" in complaint(emulator)
    finally:
        emulator.close()


def test_a_firmware_without_the_speed_command_is_told(vertiq_emulator, monkeypatch):
    monkeypatch.setattr(vertiq_search, "ANSWER_S", 0.5)  # of a busy computer
    vertiq_emulator.mangle = lambda reply: b"" if reply[2] == iquart.TIMEOUT.type else reply
    assert "needs the speed firmware" in complaint(vertiq_emulator)


def test_a_module_without_power_is_told(vertiq_emulator):
    vertiq_emulator.mangle = lambda _: b""
    assert "check its power, wiring" in complaint(vertiq_emulator)


@pytest.mark.parametrize("speed", [math.nan, math.inf, -1e300, 1001.0])
def test_a_speed_that_no_controller_means_disarms(bench, speed):
    running = lambda: bench.emulator.mode == VELOCITY_MODE  # noqa: E731
    assert bench.run(20.0, steady, until=running)
    bench.driver.command(speed)
    assert bench.driver.arming.reason.startswith(
        f"commanded speed is {speed:g} rad/s, expected 1000"
    )
    assert bench.driver.rejected == 1
