# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The devices of a whole robot made of software, where real drivers find them: files of one folder.

rotor     pseudo-terminal of the module (a symbolic link)
pwmchip0  PWM chip of the rudder servo
i2c       Unix socket of the bus with the IMU at 0x4A
camera    Unix socket of the camera
"""

import errno
import random
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fish_hw.emulators.bno085 import FedBno085, Felt
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.emulators.socket_devices import SocketBus, SocketPictures
from fish_hw.emulators.vertiq import VertiqEmulator
from fish_hw.settings import RudderSettings
from fish_hw.transport.unix_socket import PREFIX

IMU_ADDRESS = 0x4A
CELLS, CELL_V = 3, 3.7  # of the battery, until the simulator says its voltage
LAG_S = 0.01  # s, of the rotor's velocity loop
BUS_ERRORS = (errno.EIO, errno.ETIMEDOUT, errno.EREMOTEIO)


class FakeRobot:
    """Makes the devices; `faults` names what can be done to them, and `mend` ends all of it.

    Args:
        folder: where the drivers find the devices.
        servo: geometry of the rudder servo.
        seed: of the noise that faults make.
        clock: s, by which the devices move; the drivers' clock.
    """

    def __init__(
        self,
        folder: Path,
        servo: RudderSettings,
        seed: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder, self._servo, self._clock = folder, servo, clock
        folder.mkdir(parents=True, exist_ok=True)
        self._random = random.Random(seed)
        self.imu = FedBno085(clock)
        self.bus = SocketBus(folder / "i2c", {IMU_ADDRESS: self.imu})
        self.camera = SocketPictures(folder / "camera")
        chip = folder / "pwmchip0"
        self._chip = None if chip.exists() else PwmChipEmulator(chip, servo.channel)
        self._duty = chip / f"pwm{servo.channel}" / "duty_cycle"
        self._enable = chip / f"pwm{servo.channel}" / "enable"
        self._angle = 0.0
        self._held: Felt | None = None
        self.rotor = self._plug_rotor()
        self.faults: dict[str, Callable[[], None]] = {
            "rotor unplug": self._unplug_rotor,
            "rotor garbage": lambda: self._mangle(self._garbage),
            "rotor crc": lambda: self._mangle(lambda reply: reply[:-1] + bytes([reply[-1] ^ 1])),
            "rotor silent": lambda: self._mangle(lambda _: b""),
            "rotor reboot": self._reboot,
            "rotor jam": lambda: setattr(self.rotor, "jammed", True),
            "rotor stuck": self._stick,
            "rotor hot": lambda: setattr(self.rotor, "coil_c", 95.0),
            "rotor fault": lambda: setattr(self.rotor, "faults", 0b1000),
            "imu unplug": self.bus.unplug,
            "imu errors": lambda: self._fail_bus(0.5),
            "imu gone": lambda: self._fail_bus(1.0),
            "imu reset": self.imu.reset,
            "imu frozen": self._freeze_imu,
            "imu bits": self._flip_bits,
            "imu step": self._step_imu,
            "camera unplug": self.camera.unplug,
            "camera frozen": lambda: setattr(self.camera, "frozen", True),
            "rudder off": lambda: self._write(self._enable, "0"),
        }

    def parameters(self) -> dict[str, dict[str, object]]:
        """What each driver's parameter file must say to find its device."""
        return {
            "rotor": {"port": str(self.folder / "rotor"), "battery_cells": CELLS},
            "rudder": {"chip": str(self.folder / "pwmchip0")},
            "imu": {"bus": f"{PREFIX}{self.folder / 'i2c'}"},
            "camera": {"device": f"{PREFIX}{self.folder / 'camera'}"},
        }

    def rotor_speed(self) -> float:
        """Speed of the rotor [rad/s]; one whose cable is out runs on until its own watchdog coasts it."""
        self.rotor.move()
        return self.rotor.velocity

    def rudder_angle(self) -> float:
        """Rudder angle [rad] that the pulses ask for; without pulses the servo stays where it is."""
        try:
            if int(self._enable.read_text() or 0):
                us = int(self._duty.read_text()) / 1000
                servo = self._servo
                self._angle = (us - servo.centre_us) / (servo.us_per_rad * servo.sign) - servo.trim
        except (ValueError, OSError):  # read in the middle of a write
            pass
        return self._angle

    def mend(self) -> None:
        """Everything as new; what was unplugged is plugged again."""
        if not (self.folder / "rotor").is_symlink():
            self.rotor = self._plug_rotor()
        rotor = self.rotor
        rotor.jammed, rotor.frozen, rotor.coil_c, rotor.faults = False, None, 40.0, 0
        rotor.mangle = lambda reply: reply
        self.bus.fault = lambda: None
        self.imu.alter, self._held = (lambda felt: felt), None
        self.bus.plug()
        self.camera.plug()
        self.camera.frozen = False

    def close(self) -> None:
        """Take everything away."""
        self._unplug_rotor()
        self.bus.unplug()
        self.camera.unplug()

    def _plug_rotor(self) -> VertiqEmulator:
        rotor = VertiqEmulator(lag_s=LAG_S, clock=self._clock)
        rotor.volts = CELLS * CELL_V
        link = self.folder / "rotor"
        link.unlink(missing_ok=True)
        link.symlink_to(rotor.port)
        return rotor

    def _unplug_rotor(self) -> None:
        (self.folder / "rotor").unlink(missing_ok=True)
        self.rotor.close()

    def _mangle(self, how: Callable[[bytes], bytes]) -> None:
        self.rotor.mangle = how

    def _garbage(self, reply: bytes) -> bytes:
        return self._random.randbytes(self._random.randrange(20)) + reply

    def _reboot(self) -> None:
        self.rotor.reboot()

    def _stick(self) -> None:
        self.rotor.frozen = (self.rotor.velocity, self.rotor.angle)

    def _fail_bus(self, share: float) -> None:
        self.bus.fault = lambda: (
            self._random.choice(BUS_ERRORS) if self._random.random() < share else None
        )

    def _freeze_imu(self) -> None:
        def hold(felt: Felt) -> Felt:
            self._held = self._held or felt
            return replace(self._held, time_s=felt.time_s)

        self.imu.alter = hold

    def _flip_bits(self) -> None:
        """Now and then the turn rate is another number that the sensor could have measured."""

        def flip(felt: Felt) -> Felt:
            if self._random.random() > 0.05:
                return felt
            x, y, z = felt.angular_velocity
            return replace(felt, angular_velocity=(x, y, z + self._random.choice((-8.0, 8.0))))

        self.imu.alter = flip

    def _step_imu(self) -> None:
        def step(felt: Felt) -> Felt:
            x, y, z = felt.angular_velocity
            return replace(felt, angular_velocity=(x, y, z + 6.0))

        self.imu.alter = step

    def _write(self, file: Path, text: str) -> None:
        file.write_text(text)
