# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The real RotorDriver on an emulated module, both on one simulated clock: what is measured does not depend on the computer."""

import math
from collections.abc import Callable

from fish_hw.devices.leak_sensor import LeakSensor
from fish_hw.devices.rotor_driver import RUDDER, RotorDriver
from fish_hw.emulators.vertiq import VertiqModule
from fish_hw.settings import RotorSettings
from fish_hw.transport.interfaces import TransportError
from fish_node.arming import CAMERA, DEADMAN, ODOMETRY

DT = 0.01  # s, of the driver
SLICE_S = 0.001  # s, of the clock while somebody waits for bytes
LINE_S = 0.003  # s from a question to its answers: 30 bytes at 115200 baud
PERIODS_S = {ODOMETRY: 0.01, CAMERA: 1 / 30, RUDDER: 0.05, DEADMAN: 0.1}  # of what the driver hears
AMPLITUDE, FREQUENCY = 9.0, 2.0 * math.tau  # rad, rad/s: 2 Hz
SETTINGS = RotorSettings(deadman_timeout_s=0.25)


class Clock:
    """Simulated time [s]."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        """The time."""
        return self.now


class Line:
    """ByteStream to a module; whoever waits for bytes lets the time pass."""

    def __init__(self, module: VertiqModule, clock: Clock) -> None:
        self.unplugged = False
        self._module, self._clock = module, clock
        self._replies: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        """To the module."""
        self._check()
        self._module.move()
        if replies := self._module.feed(data):
            self._replies.append((self._clock.now + LINE_S, replies))

    def read(self, timeout_s: float) -> bytes:
        """What has arrived within timeout_s."""
        self._check()
        end = self._clock.now + timeout_s
        while not (self._replies and self._replies[0][0] <= self._clock.now):
            if self._clock.now >= end:
                return b""
            self._clock.now = min(self._clock.now + SLICE_S, end)
        return self._replies.pop(0)[1]

    def close(self) -> None:
        """Nothing to give back."""

    def _check(self) -> None:
        if self.unplugged:
            raise TransportError("emulated line: unplugged")


class Wire:
    """GPIO line of a leak sensor."""

    def __init__(self) -> None:
        self.low = False

    def wait(self, timeout_s: float) -> float | None:  # noqa: ARG002
        """No edges."""
        return None

    def is_low(self) -> bool:
        """Whether the sensor is wet."""
        return self.low

    def close(self) -> None:
        """Nothing to give back."""


class LockstepRotor:
    """A swimming robot as its rotor driver sees it.

    Attributes:
        silent: names of what ceased to come: joint_command and the keys of PERIODS_S.
        troubles: name -> what is wrong with it.
        dead: the driver's process was killed.
    """

    def __init__(self, settings: RotorSettings = SETTINGS) -> None:
        self.clock = Clock()
        self.module = VertiqModule(settings.module_id, 0.02, self.clock)
        self.line = Line(self.module, self.clock)
        self.wire = Wire()
        self.settings = settings
        self.driver = self.new_driver()
        self.silent: set[str] = set()
        self.troubles: dict[str, str] = {}
        self.dead = False
        self.speed: Callable[[float], float] = lambda t: (
            AMPLITUDE * FREQUENCY * math.sin(FREQUENCY * t)
        )
        self.later: list[tuple[float, Callable[[], None]]] = []  # (s, what happens then)
        self._heard = dict.fromkeys(PERIODS_S, -math.inf)
        self._due = self.clock.now

    def new_driver(self) -> RotorDriver:
        """A driver that was started now."""
        leak = LeakSensor(lambda: self.wire, wet_is_low=True)
        return RotorDriver(self.settings, lambda: self.line, self.clock, leak=leak)

    def run(self, duration_s: float) -> None:
        """Let the time pass."""
        end = self.clock.now + duration_s
        while self.clock.now < end:
            self._happen()
            self._hear()
            self._step_driver()
            self._due = max(self._due + DT, self.clock.now)
            self.clock.now = self._due
            self.module.move()

    def arm(self) -> str:
        """As the operator; what speaks against it."""
        return self.driver.arming.arm(self.clock.now)

    def at(self, delay_s: float, what: Callable[[], None]) -> None:
        """Let something happen after a while."""
        self.later.append((self.clock.now + delay_s, what))

    def _step_driver(self) -> None:
        if not self.dead:
            self.driver.step()

    def _happen(self) -> None:
        due = [entry for entry in self.later if entry[0] <= self.clock.now]
        self.later = [entry for entry in self.later if entry[0] > self.clock.now]
        for _, what in due:
            what()

    def _hear(self) -> None:
        now = self.clock.now
        if "joint_command" not in self.silent:
            self.driver.command(self.speed(now))
        for name, period_s in PERIODS_S.items():
            if name not in self.silent and now >= self._heard[name] + period_s - 1e-9:
                self._heard[name] = now
                self.driver.arming.heard(name, now, self.troubles.get(name, ""))
