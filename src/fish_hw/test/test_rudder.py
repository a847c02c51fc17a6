# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rudder: pulses, limits, watchdog, both PWM outputs, and the driver around them."""

import errno
import itertools
import math
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from fakes import refuse_as_sysfs_does, wait_until

from fish_hw.devices import rudder_output
from fish_hw.devices.reconnect import ERROR, OK, WARN, Loss
from fish_hw.devices.rudder_driver import RudderDriver, RudderServo
from fish_hw.devices.rudder_output import Pca9685Pwm, open_output, prescale
from fish_hw.emulators.i2c_bus import I2cBusEmulator
from fish_hw.emulators.pwm import Pca9685Emulator, PwmChipEmulator
from fish_hw.settings import RudderSettings
from fish_hw.transport.interfaces import PortUnavailable, TransportError
from fish_hw.transport.sysfs_pwm import SysfsPwm

SETTINGS = RudderSettings()
DT = 0.01
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["left", "right"])
PCA_COUNTS = {
    500: 102,
    900: 184,
    1000: 205,
    1250: 256,
    1500: 307,
    1750: 359,
    2000: 410,
    2100: 430,
    2500: 512,
}


@pytest.mark.parametrize(
    ("alpha", "change", "pulse_us"),
    [
        (0.0, {}, 1500.0),
        (0.5, {}, 1786.5),
        (0.5, {"sign": -1}, 1213.5),
        (0.5, {"us_per_rad": 400.0}, 1700.0),
        (0.0, {"trim": 0.1}, 1557.3),
        (0.8, {"max_us": 1800.0}, 1800.0),
        (-0.8, {"trim": -0.4}, 1000.0),
    ],
)
def test_pulse(alpha, change, pulse_us):
    assert RudderServo(replace(SETTINGS, **change)).pulse_ns(alpha) == round(1000 * pulse_us)


class ServoBench:
    def __init__(self) -> None:
        self.servo = RudderServo(SETTINGS)
        self.now = 5.0

    def run(self, duration_s: float, alpha: float | None = None) -> list[float]:
        angles = []
        for _ in range(round(duration_s / DT)):
            if alpha is not None:
                self.servo.command(alpha, self.now)
            self.servo.armed(True, self.now)
            self.servo.step(self.now)
            angles.append(self.servo.alpha)
            self.now += DT
        return angles


def test_a_servo_without_commands_stays_in_the_centre():
    assert ServoBench().run(0.5) == [0.0] * 50


@BOTH_WAYS
def test_slew_and_range(direction):
    bench = ServoBench()
    angles = [direction * a for a in bench.run(1.0, direction * 2.0)]
    steps = [b - a for a, b in zip([0.0, *angles], angles, strict=False)]
    assert steps[0] == 0.0
    assert max(steps) == pytest.approx(SETTINGS.max_rate * DT)
    assert angles[-1] == SETTINGS.max_angle
    assert bench.servo.counters.clamped == 100


@BOTH_WAYS
def test_stale_command_centres_at_the_slew_rate(direction):
    bench = ServoBench()
    bench.run(1.0, direction * 0.6)
    assert bench.servo.counters.clamped == 0
    angles = [direction * a for a in bench.run(1.0)]
    held = sum(a == pytest.approx(0.6) for a in angles)
    assert held * DT == pytest.approx(SETTINGS.stale_s, abs=2 * DT)
    assert max(a - b for a, b in itertools.pairwise(angles)) == pytest.approx(
        SETTINGS.max_rate * DT
    )
    assert angles[-1] == 0.0


def test_a_disarmed_servo_centres_and_stays_there_until_armed():
    bench = ServoBench()
    bench.run(1.0, 0.6)
    for _ in range(100):
        bench.servo.armed(False, bench.now)
        bench.servo.command(0.6, bench.now)
        bench.servo.step(bench.now)
        bench.now += DT
    assert bench.servo.alpha == 0.0
    assert bench.servo.idle(bench.now) == "disarmed"
    assert bench.run(1.0, 0.6)[-1] == pytest.approx(0.6)


def test_a_servo_that_hears_nothing_of_the_arming_state_centres():
    bench = ServoBench()
    bench.run(1.0, 0.6)
    for _ in range(100):
        bench.servo.command(0.6, bench.now)
        bench.servo.step(bench.now)
        bench.now += DT
    assert bench.servo.alpha == 0.0
    assert "no arming/state for 0.2 s" in bench.servo.idle(bench.now)


def test_a_servo_that_stopped_by_itself_stays_in_the_centre_until_it_was_disarmed():
    bench = ServoBench()
    bench.run(1.0, 0.6)
    for _ in range(60):
        bench.servo.armed(True, bench.now)
        bench.servo.step(bench.now)
        bench.now += DT
    assert "no command for 0.25 s" in bench.servo.stop
    assert bench.run(1.0, 0.6)[-1] == 0.0
    bench.servo.armed(False, bench.now)
    assert bench.servo.stop == ""
    assert bench.run(1.0, 0.6)[-1] == pytest.approx(0.6)


def test_a_servo_that_never_followed_may_wait_for_its_first_command():
    bench = ServoBench()
    bench.run(1.0)
    assert bench.servo.stop == ""
    assert bench.run(1.0, 0.6)[-1] == pytest.approx(0.6)


def test_a_late_cycle_earns_no_jump():
    bench = ServoBench()
    bench.run(0.1, 0.0)
    bench.now += 5.0
    bench.servo.command(0.8, bench.now)
    bench.servo.armed(True, bench.now)
    bench.servo.step(bench.now)
    assert 0.0 < bench.servo.alpha <= SETTINGS.max_rate * 0.05 + 1e-12


@pytest.mark.parametrize("back_s", [0.005, 1000.0])
def test_a_clock_that_goes_back_moves_no_servo(back_s):
    bench = ServoBench()
    angle = bench.run(1.0, 0.6)[-1]
    bench.servo.step(bench.now - back_s)
    assert bench.servo.alpha == angle


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_bad_numbers_do_not_feed_the_watchdog(bad):
    bench = ServoBench()
    bench.run(0.5, 0.6)
    assert bench.run(1.0, bad)[-1] == 0.0
    assert bench.servo.counters.rejected == 100


def test_pca9685_start_sequence_and_counts():
    board, slept = Pca9685Emulator(), []
    pwm = Pca9685Pwm(
        I2cBusEmulator({0x40: board}),
        0x40,
        0,
        25e6,
        50.0,
        sleep=lambda s: slept.append((len(board.log), s)),
    )
    pwm.start(1_500_000)
    assert [w.hex(" ") for w in board.log] == [
        "00 00",
        "00 10",
        "fe 79",
        "00 00",
        "00 a0",
        "06 00 00 33 01",
    ]
    [(written, waited_s)] = slept
    assert written == 4
    assert waited_s >= 500e-6
    for us, count in PCA_COUNTS.items():
        pwm.set_pulse_ns(1000 * us)
        assert board.log[-1] == bytes([0x06, 0, 0]) + count.to_bytes(2, "little")
    pwm.set_pulse_ns(
        30_000_000
    )  # longer than the period: bit 12 of the counter would be "full off"
    assert board.pulse_counts(0) == (0, 4095)
    pwm.stop()
    assert board.log[-1].hex(" ") == "06 00 00 00 10"


def test_pca9685_that_sleeps_or_has_another_rate_is_not_running():
    board = Pca9685Emulator()
    pwm = Pca9685Pwm(I2cBusEmulator({0x40: board}), 0x40, 0, 25e6, 50.0, sleep=lambda _: None)
    pwm.start(1_500_000)
    assert pwm.is_running()
    board.registers[0x00] |= 0x10  # put to sleep, its rate kept
    assert not pwm.is_running()
    pwm.start(1_500_000)
    board.registers[0xFE] = 0x1E  # another program's rate, still awake
    assert not pwm.is_running()
    pwm.start(1_500_000)
    board.power_cycle()
    assert not pwm.is_running()


def test_pca9685_channel_and_real_clock():
    board = Pca9685Emulator()
    pwm = Pca9685Pwm(I2cBusEmulator({0x40: board}), 0x40, 3, 26e6, 50.0, sleep=lambda _: None)
    pwm.start(1_500_000)
    on, off = board.pulse_counts(3)
    assert on == 0
    assert off * (board.registers[0xFE] + 1) / 26e6 == pytest.approx(1.5e-3, abs=5e-6)


def test_prescale():
    assert prescale(25e6, 50.0) == 121
    assert (prescale(25e6, 1526.0), prescale(25e6, 23.84)) == (3, 255)  # the datasheet's range
    for pwm_hz in (23.7, 1800.0):
        with pytest.raises(ValueError, match="has 3 to 255"):
            prescale(25e6, pwm_hz)


@pytest.fixture
def chip(tmp_path, monkeypatch):
    refuse_as_sysfs_does(monkeypatch)
    return PwmChipEmulator(tmp_path / "pwmchip0")


@pytest.mark.parametrize("us", [500, 1000, 1500, 2500])
def test_sysfs_pulse(chip, us):
    pwm = SysfsPwm(str(chip.chip), 0, 20_000_000)
    pwm.start(1_500_000)
    pwm.set_pulse_ns(1000 * us)
    assert (chip.read("period"), chip.read("duty_cycle"), chip.read("enable")) == (
        20_000_000,
        1000 * us,
        1,
    )
    assert pwm.is_running()
    pwm.stop()
    assert not pwm.is_running()


@pytest.mark.parametrize("left", [0, 1_900_000, 30_000_000])
def test_sysfs_starts_whatever_the_channel_was_left_at(chip, left):
    """At boot the period is 0; after another program the pulse may be longer than our period."""
    if left:
        (chip.channel / "period").write_text("40000000\n")
        (chip.channel / "duty_cycle").write_text(f"{left}\n")
    SysfsPwm(str(chip.chip), 0, 20_000_000).start(1_500_000)
    assert (chip.read("period"), chip.read("duty_cycle"), chip.read("enable")) == (
        20_000_000,
        1_500_000,
        1,
    )


@pytest.mark.parametrize("left", [(0, 0, 0), (40_000_000, 30_000_000, 1), (20_000_000, 0, 0)])
def test_sysfs_channel_that_was_left_inversed_is_normal_again(chip, left):
    """Inversed, a pulse of 1.5 ms would be one of 18.5 ms."""
    for name, value in zip(("period", "duty_cycle", "enable"), left, strict=True):
        with open(chip.channel / name, "w") as file:  # whatever the kernel says
            file.write(f"{value}\n")
    with open(chip.channel / "polarity", "w") as file:
        file.write("inversed\n")
    SysfsPwm(str(chip.chip), 0, 20_000_000).start(1_500_000)
    assert (chip.channel / "polarity").read_text() == "normal\n"
    assert (chip.read("period"), chip.read("duty_cycle"), chip.read("enable")) == (
        20_000_000,
        1_500_000,
        1,
    )


def test_sysfs_channel_with_another_period_is_not_running(chip):
    pwm = SysfsPwm(str(chip.chip), 0, 20_000_000)
    pwm.start(1_500_000)
    (chip.channel / "period").write_text("10000000\n")
    assert not pwm.is_running()
    pwm.start(1_500_000)
    assert pwm.is_running()


def test_sysfs_export_waits_for_the_files(tmp_path):
    """The kernel makes the channel's files some time after the export."""
    folder = tmp_path / "pwmchip0"
    folder.mkdir()
    (folder / "export").write_text("")

    def kernel() -> None:
        wait_until(lambda: (folder / "export").read_text() == "1\n")
        made = PwmChipEmulator(tmp_path / "made", 1)
        os.rename(made.channel, folder / "pwm1")

    thread = threading.Thread(target=kernel)
    thread.start()
    SysfsPwm(str(folder), 1, 20_000_000).start(1_500_000)
    thread.join()
    assert (folder / "pwm1" / "duty_cycle").read_text() == "1500000\n"


def refuse_export(monkeypatch, folder, code: int, exported: bool) -> None:
    """The kernel refuses an export; with `exported` because somebody else was faster."""
    plain = Path.write_text

    def write_text(path: Path, text: str) -> int:
        if path != folder / "export":
            return plain(path, text)
        if exported:
            os.rename(PwmChipEmulator(folder.parent / "made").channel, folder / "pwm0")
        raise OSError(code, os.strerror(code))

    folder.mkdir()
    plain(folder / "export", "")
    monkeypatch.setattr(Path, "write_text", write_text)


def test_sysfs_channel_that_somebody_else_exports_at_the_same_time(tmp_path, monkeypatch):
    folder = tmp_path / "pwmchip0"
    refuse_export(monkeypatch, folder, errno.EBUSY, exported=True)
    SysfsPwm(str(folder), 0, 20_000_000).start(1_500_000)
    assert (folder / "pwm0" / "enable").read_text() == "1\n"


def test_sysfs_export_that_is_refused_says_why(tmp_path, monkeypatch):
    folder = tmp_path / "pwmchip0"
    refuse_export(monkeypatch, folder, errno.ENODEV, exported=False)
    with pytest.raises(PortUnavailable, match="the chip has no such channel"):
        SysfsPwm(str(folder), 0, 20_000_000, sleep=lambda _: None)


def test_sysfs_files_that_never_become_writable(tmp_path):
    folder = tmp_path / "pwmchip0"
    folder.mkdir()
    (folder / "export").write_text("")
    with pytest.raises(PortUnavailable, match=r"period, duty_cycle and enable did not appear"):
        SysfsPwm(str(folder), 0, 20_000_000, sleep=lambda _: None)


def test_sysfs_absent_chip_lists_the_others(chip, tmp_path):
    with pytest.raises(PortUnavailable, match=f"no such chip.*available: {chip.chip}"):
        SysfsPwm(str(tmp_path / "pwmchip4"), 0, 20_000_000)


def test_the_output_of_the_settings_on_sysfs(tmp_path):
    chip = PwmChipEmulator(tmp_path / "pwmchip0", channel=1)
    open_output(RudderSettings(chip=str(chip.chip), channel=1, pwm_hz=100.0)).start(1_500_000)
    assert (chip.read("period"), chip.read("duty_cycle")) == (10_000_000, 1_500_000)


def test_the_output_of_the_settings_on_a_board(monkeypatch):
    board, opened = Pca9685Emulator(), []
    bus = I2cBusEmulator({0x41: board})
    monkeypatch.setattr(rudder_output, "KernelI2c", lambda path: opened.append(path) or bus)
    settings = RudderSettings(
        backend="pca9685",
        bus="/dev/i2c-7",
        address=0x41,
        channel=5,
        pca_clock_hz=26e6,
        pwm_hz=100.0,
    )
    open_output(settings).start(1_500_000)
    assert opened == ["/dev/i2c-7"]
    tick_s = (board.registers[0xFE] + 1) / 26e6
    assert 4096 * tick_s == pytest.approx(1 / 100.0, rel=0.01)
    assert board.pulse_counts(5)[1] * tick_s == pytest.approx(1.5e-3, rel=0.01)


class DriverBench:
    """The driver on an emulated chip and a simulated clock."""

    def __init__(self, chip: PwmChipEmulator, settings: RudderSettings = SETTINGS) -> None:
        self.now = 50.0
        self.slept = []
        self.driver = RudderDriver(
            settings, lambda: SysfsPwm(str(chip.chip), 0, 20_000_000), self.clock, self.sleep
        )
        self.events = []

    def clock(self) -> float:
        return self.now

    def sleep(self, duration_s: float) -> None:
        self.slept.append(duration_s)

    def run(self, duration_s: float, alpha: float | None = None) -> None:
        end = self.now + duration_s
        while self.now < end:
            self.now += DT
            if alpha is not None:
                self.driver.command(alpha)
            self.driver.armed(True)
            self.events += self.driver.step()


def test_driver_starts_centred_and_follows(chip):
    bench = DriverBench(chip)
    bench.driver.connect()
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 1)
    bench.run(0.5, 0.5)
    assert chip.read("duty_cycle") == 1_786_500
    assert bench.driver.status().level == OK
    bench.run(1.0)
    assert chip.read("duty_cycle") == 1_500_000
    assert bench.driver.status().level == WARN
    assert bench.events == ["rudder follows commands", "rudder centred: no command for 0.25 s"]
    assert bench.driver.trouble == "no command for 0.25 s"  # the owner of the arming state disarms
    bench.driver.armed(False)
    assert bench.driver.trouble == ""


@BOTH_WAYS
def test_close_centres_and_gives_the_servo_time_before_the_pulses_end(chip, direction):
    bench = DriverBench(chip, replace(SETTINGS, max_rate=2.0))
    bench.driver.connect()
    bench.run(1.5, direction * 0.6)
    bench.driver.close()
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)
    assert 0.6 / 2.0 <= bench.slept[-1] < 0.6 / 2.0 + 0.2
    assert not bench.driver.connected
    bench.driver.close()  # once is enough
    assert len(bench.slept) == 1


def test_close_right_after_the_start_waits_for_a_servo_that_stood_anywhere(chip):
    """safe_stop knows nothing of the angle that the killed node had sent."""
    bench = DriverBench(chip)
    bench.driver.connect()
    bench.driver.close()
    end_to_end_s = 2 * SETTINGS.max_angle / SETTINGS.max_rate
    assert end_to_end_s <= bench.slept[-1] < end_to_end_s + 0.2
    bench.driver.connect()
    bench.run(1.0)
    bench.driver.close()
    assert bench.slept[-1] < 0.2  # centred long ago


def test_close_can_leave_the_pulses_on(chip):
    bench = DriverBench(chip, replace(SETTINGS, off_at_exit=False))
    bench.driver.connect()
    bench.run(0.5, 0.6)
    bench.driver.close()
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 1)


def test_output_that_somebody_switches_off_is_started_again(chip):
    bench = DriverBench(chip)
    bench.driver.connect()
    bench.run(0.5, 0.6)
    (chip.channel / "enable").write_text("0\n")
    bench.run(1.2, 0.6)
    assert any("stopped by itself" in event for event in bench.events)
    bench.run(2.0, 0.6)
    assert chip.read("enable") == 1
    assert chip.read("duty_cycle") == SETTINGS.us_per_rad * 600 + 1_500_000
    assert bench.events[-1] == "rudder output connected again"


def test_output_that_does_not_stay_on_is_lost_once(chip):
    bench = DriverBench(chip)
    bench.driver.connect()
    for _ in range(20):
        (chip.channel / "enable").write_text("0\n")
        bench.run(1.0, 0.6)
        (chip.channel / "enable").write_text("0\n")
    lost = [event for event in bench.events if isinstance(event, Loss)]
    assert len(lost) == 1
    assert "connected again" not in " ".join(bench.events)
    bench.run(8.0, 0.6)
    assert bench.events[-1] == "rudder output connected again"
    (chip.channel / "enable").write_text("0\n")
    bench.run(1.5, 0.6)
    assert bench.events[-1] == lost[0]


def test_bus_error_loses_the_board_and_finds_it_again():
    board = Pca9685Emulator()
    bus = I2cBusEmulator({0x40: board})
    now = [0.0]
    driver = RudderDriver(
        SETTINGS,
        lambda: Pca9685Pwm(bus, 0x40, 0, 25e6, 50.0, sleep=lambda _: None),
        clock=lambda: now[0],
        sleep=lambda _: None,
    )
    driver.connect()
    events = []

    def run(duration_s: float) -> None:
        for _ in range(round(duration_s / DT)):
            now[0] += DT
            driver.armed(True)
            driver.command(0.3 if now[0] % 0.4 < 0.2 else -0.3)
            events.extend(driver.step())

    run(0.5)
    bus.fault = lambda: errno.EREMOTEIO
    run(0.1)
    assert bus.closed
    bus.closed = False
    run(4.0)
    assert bus.closed  # also by attempts that fail half-way: descriptors are few
    assert driver.status().level == ERROR
    assert not driver.connected
    assert len(events) == 2  # follows, lost: not one line per attempt
    bus.fault = lambda: None
    board.power_cycle()
    run(6.0)
    assert driver.connected
    assert board.registers[0xFE] == 121
    bus.closed, bus.fault = False, lambda: errno.EREMOTEIO
    driver.close()
    assert bus.closed
    assert "not centred" in driver.status().message


def test_absent_output_is_raised_at_start(tmp_path):
    driver = RudderDriver(SETTINGS, lambda: SysfsPwm(str(tmp_path / "pwmchip0"), 0, 20_000_000))
    with pytest.raises(PortUnavailable):
        driver.connect()
    driver.close()  # of nothing


def test_write_that_fails_is_a_transport_error(chip):
    pwm = SysfsPwm(str(chip.chip), 0, 20_000_000)
    (chip.channel / "duty_cycle").unlink()
    (chip.channel / "duty_cycle").mkdir()
    with pytest.raises(TransportError, match="cannot write 1500000 to duty_cycle"):
        pwm.set_pulse_ns(1_500_000)
