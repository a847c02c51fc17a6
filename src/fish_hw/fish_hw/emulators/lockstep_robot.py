# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A whole robot on one simulated clock: the four real drivers on emulated devices, and faults of each.

What the computer is busy with changes nothing, and hours pass in minutes. The estimate is a model: fusion says it with every
IMU sample, and without one for FUSION_IMU_S it says with the next pose that the IMU is lost.
"""

import errno
import math
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from fish_hw.devices.imu_driver import ImuDriver
from fish_hw.devices.rotor_driver import RUDDER
from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.devices.usb_camera import UsbCamera
from fish_hw.emulators.bno085 import FedBno085, Felt
from fish_hw.emulators.i2c_bus import I2cBusEmulator
from fish_hw.emulators.lockstep_rotor import DT, LockstepRotor
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.settings import CameraSettings, ImuSettings, RotorSettings, RudderSettings
from fish_hw.transport.interfaces import PortUnavailable
from fish_hw.transport.sysfs_pwm import SysfsPwm
from fish_hw.transport.video_capture import Frame
from fish_node.arming import CAMERA, DEADMAN, ODOMETRY

FUSION_IMU_S = 0.1  # s, imu_timeout of fusion
PICTURE_S = 1 / 30  # s between pictures
SPAN = 0.3  # rad, of the rudder that is commanded
JPEG_HEAD = bytes.fromhex("ffd8 ffc0 0011 08 02d0 0500 03 012200 021101 031101")  # 1280 x 720
BUS_ERRORS = (errno.EIO, errno.ETIMEDOUT, errno.EREMOTEIO)


class Pictures:
    """A camera's end: a new picture at each read, or the same one again."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.plugged, self.frozen = True, False
        self._clock, self._count = clock, 0

    def open(self) -> "Pictures":
        """As the driver opens it."""
        if not self.plugged:
            raise PortUnavailable("cannot open camera emulated: there is no such device")
        return self

    def read(self) -> Frame | None:
        """The picture of now."""
        if not self.plugged:
            return None
        self._count += not self.frozen
        jpeg = JPEG_HEAD + self._count.to_bytes(4, "big") + b"\xff\xd9"
        return Frame(self._clock(), jpeg=jpeg)

    def close(self) -> None:
        """Nothing to give back."""


class LockstepRobot(LockstepRotor):
    """A swimming robot: rotor, rudder, IMU and camera by their real drivers.

    Attributes:
        faults: name -> what breaks; `mend` ends all of it, and starts what was killed again.
        angles: (s, rad) of the rudder as its pulses say.
        states: (s, whether the robot is armed) after each cycle of the rotor's driver.

    Args:
        folder: for the files of the PWM chip.
        seed: of all noise.
    """

    def __init__(self, folder: Path, seed: int = 0) -> None:
        super().__init__(RotorSettings())
        self.chance = random.Random(seed)
        self.angles: list[tuple[float, float]] = []
        self.states: list[tuple[float, bool]] = []
        self.alpha = SPAN
        self._dead: set[str] = set()
        self._hub = FedBno085(self.clock)
        self._bus = I2cBusEmulator({ImuSettings.address: self._hub})
        self._pictures = Pictures(self.clock)
        self.servo = RudderSettings()
        self._chip = PwmChipEmulator(folder / "pwmchip0", self.servo.channel)
        self._held: Felt | None = None
        self._sample_s = self._picture_due = self._pose_due = self.clock.now
        self._sleeps = False
        self._start("imu", "camera", "rudder")
        self.driver.connect()
        self.faults = self._device_faults() | {
            f"kill {name}": lambda name=name: self._dead.add(name)
            for name in ("rotor", "rudder", "imu", "camera", "tracker", "fusion", "controller")
        }

    def mend(self) -> None:
        """Everything as new; what was killed is started again, disarmed."""
        module = self.module
        module.jammed, module.frozen, module.coil_c, module.faults = False, None, 40.0, 0
        module.volts, module.mangle = 14.8, lambda reply: reply
        self.line.unplugged = False
        self._bus.fault, self._hub.alter, self._held = (lambda: None), (lambda felt: felt), None
        self._pictures.plugged, self._pictures.frozen = True, False
        self.wire.low = False
        dead, self._dead = self._dead, set()
        self._start(*dead)

    @property
    def swims(self) -> bool:
        """Whether the rotor and the rudder follow the commands."""
        return abs(self.module.velocity) > 1.0 and abs(self.rudder_angle - self.alpha) < 0.01

    @property
    def rudder_angle(self) -> float:
        """Rudder angle [rad] that the pulses ask for."""
        servo, us = self.servo, self._chip.read("duty_cycle") / 1000
        return (us - servo.centre_us) / (servo.us_per_rad * servo.sign) - servo.trim

    def _start(self, *names: str) -> None:
        """New processes of drivers."""
        if "rotor" in names:
            self.driver.close()
            self.driver = self.new_driver()
        if "imu" in names:
            settings = ImuSettings()
            self._imu = ImuDriver(
                settings, lambda: self._bus, lambda: None, self._no_port, self.clock, self._sleep
            )
        if "camera" in names:
            self._camera = UsbCamera(CameraSettings(), self._pictures.open, self.clock)
        if "rudder" in names:
            self._rudder = RudderDriver(self.servo, self._output, self.clock, lambda _: None)

    def _no_port(self) -> NoReturn:
        raise PortUnavailable("cannot open a serial port: there is none")

    def _output(self) -> SysfsPwm:
        return SysfsPwm(
            str(self._chip.chip),
            self.servo.channel,
            round(1e9 / self.servo.pwm_hz),
            lambda _: None,
        )

    def _sleep(self, duration_s: float) -> None:
        """The IMU's driver waits, the others go on."""
        self._sleeps = True
        self.run(duration_s)
        self._sleeps = False

    def _step_driver(self) -> None:
        if "rotor" not in self._dead:
            self.driver.step()
            self.states.append((self.clock.now, self.driver.arming.armed))

    def arm(self) -> str:
        """As the operator; what speaks against it."""
        refusal = super().arm()
        self.states.append((self.clock.now, not refusal))
        return refusal

    def _hear(self) -> None:
        now = self.clock.now
        arming = self.driver.arming
        if "controller" not in self._dead:
            self.driver.command(self.speed(now))
            self._rudder.command(self.alpha)
        arming.heard(DEADMAN, now)
        self._step_rudder(now)
        if not self._sleeps:
            self._step_imu(now)
        self._step_camera(now)
        if "rudder" not in self._dead:
            arming.heard(RUDDER, now, self._rudder.trouble)

    def _step_rudder(self, now: float) -> None:
        if "rudder" not in self._dead:
            if "rotor" not in self._dead:
                self._rudder.armed(self.driver.arming.armed)
            self._rudder.step()
        self.angles.append((now, self.rudder_angle))

    def _step_imu(self, now: float) -> None:
        """The hub feels a turn; each sample that the driver passes on is an estimate."""
        yaw, rate = 0.3 * math.sin(2.0 * now), 0.6 * math.cos(2.0 * now)
        noise = (self.chance.gauss(0.0, 0.05), self.chance.gauss(0.0, 0.05), 9.8)
        turned = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        self._hub.feel(Felt(now - 0.002, turned, (0.0, 0.0, rate), noise))
        if "imu" in self._dead or not self._imu.step(DT).samples:
            return
        self._sample_s = self.clock.now
        if "fusion" not in self._dead:
            self.driver.arming.heard(ODOMETRY, self.clock.now)

    def _step_camera(self, now: float) -> None:
        if now < self._picture_due:
            return
        self._picture_due = max(self._picture_due + PICTURE_S, now)
        if "camera" in self._dead or self._camera.step().picture is None:
            return
        arming = self.driver.arming
        if "tracker" not in self._dead:
            arming.heard(CAMERA, now)
            if now - self._sample_s > FUSION_IMU_S and "fusion" not in self._dead:
                arming.heard(ODOMETRY, now, "IMU lost: fusion does not vouch for the velocity")

    def _device_faults(self) -> dict[str, Callable[[], object]]:
        module, pictures = self.module, self._pictures

        def mangle(how: Callable[[bytes], bytes]) -> Callable[[], object]:
            return lambda: setattr(module, "mangle", how)

        def alter(how: Callable[[Felt], Felt]) -> Callable[[], object]:
            return lambda: setattr(self._hub, "alter", how)

        def fail(share: float) -> Callable[[], object]:
            return lambda: setattr(
                self._bus,
                "fault",
                lambda: self.chance.choice(BUS_ERRORS) if self.chance.random() < share else None,
            )

        return {
            "rotor unplug": lambda: setattr(self.line, "unplugged", True),
            "rotor garbage": mangle(
                lambda reply: self.chance.randbytes(self.chance.randrange(20)) + reply
            ),
            "rotor crc": mangle(lambda reply: reply[:-1] + bytes([reply[-1] ^ 1])),
            "rotor silent": mangle(lambda _: b""),
            "rotor reboot": module.reboot,
            "rotor jam": lambda: setattr(module, "jammed", True),
            "rotor stuck": lambda: setattr(module, "frozen", (module.velocity, module.angle)),
            "rotor hot": lambda: setattr(module, "coil_c", 95.0),
            "rotor fault": lambda: setattr(module, "faults", 0b1000),
            "battery dead": lambda: setattr(module, "volts", 12.0),
            "leak": lambda: setattr(self.wire, "low", True),
            "imu errors": fail(0.5),
            "imu gone": fail(1.0),
            "imu reset": self._hub.reset,
            "imu frozen": alter(self._hold),
            "imu bits": alter(self._flip),
            "imu step": alter(lambda felt: turning(felt, 6.0)),
            "camera unplug": lambda: setattr(pictures, "plugged", False),
            "camera frozen": lambda: setattr(pictures, "frozen", True),
            "rudder off": lambda: (self._chip.channel / "enable").write_text("0\n"),
            "computer stalls": self._stall,
        }

    def _hold(self, felt: Felt) -> Felt:
        self._held = self._held or felt
        return replace(self._held, time_s=felt.time_s)

    def _flip(self, felt: Felt) -> Felt:
        """Now and then the turn rate is another number that the sensor could have measured."""
        bad = self.chance.random() < 0.05
        return turning(felt, self.chance.choice((-8.0, 8.0))) if bad else felt

    def _stall(self) -> None:
        """Nothing runs for a while."""
        self.clock.now += self.chance.uniform(0.05, 1.0)
        self.module.move()


def turning(felt: Felt, more: float) -> Felt:
    """A measurement with another turn rate [rad/s]."""
    x, y, z = felt.angular_velocity
    return replace(felt, angular_velocity=(x, y, z + more))
