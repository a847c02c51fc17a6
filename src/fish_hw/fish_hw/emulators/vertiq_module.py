# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A Vertiq 40-06 (speed firmware) made of software: bytes in, bytes out, on any clock.

The rotor follows its command with a first-order lag. As in the real module any valid message feeds the timeout.
"""

import math
import struct
from collections.abc import Callable

from fish_hw.devices import vertiq_registers as reg
from fish_hw.protocol.iquart import GET, REPLY, SET, Message, Parser, encode

VELOCITY_MODE = 4
DRIVEN_MODES = (2, 3, VELOCITY_MODE)
COMMANDS_KEPT = 100_000


class VertiqModule:
    """The module with its rotor.

    Attributes:
        jammed: the rotor is held.
        frozen: the answers of speed and angle stand still, as of a stuck encoder.
        mangle: a test's way to break replies; an empty reply is lost.
        commanded_at: (time [s], speed [rad/s]) of every speed command.

    Args:
        module: module id it answers to.
        lag_s: time constant of the rotor.
        clock: s.
    """

    def __init__(self, module: int, lag_s: float, clock: Callable[[], float]) -> None:
        self.module, self.lag_s = module, lag_s
        self.velocity = self.commanded = self.angle = 0.0
        self.mode = reg.COAST
        self.jammed = False
        self.frozen: tuple[float, float] | None = None  # speed [rad/s], angle [rad]
        self.timeouts = 0
        self.volts, self.amps, self.controller_c, self.coil_c = 14.8, 0.5, 35.0, 40.0
        self.faults = self.faults_ever = 0
        self.log: list[Message] = []
        self.commanded_at: list[tuple[float, float]] = []
        self.mangle: Callable[[bytes], bytes] = lambda reply: reply
        self.written: dict[tuple[int, int], bytes] = {}
        self.clock = clock
        self._derate = reg.DERATE_NONE
        self._time = self._fed = self._booted = clock()
        self._parser = Parser()
        self.reboot()

    def reboot(self) -> None:
        """Brown-out: back to the saved settings, resting."""
        self._booted = self.clock()
        self.mode, self.commanded = reg.COAST, 0.0
        self.written = {
            (reg.TIMEOUT.type, reg.TIMEOUT.param): struct.pack("<f", 1.0),
            (reg.TIMEOUT_BEHAVIOR.type, reg.TIMEOUT_BEHAVIOR.param): b"\x00",
            (reg.TIMEOUT_MEANING.type, reg.TIMEOUT_MEANING.param): b"\x00",
            (reg.TIMEOUT_SONG.type, reg.TIMEOUT_SONG.param): b"\x02",
            (reg.VELOCITY_KP.type, reg.VELOCITY_KP.param): struct.pack("<f", 0.02),
            (reg.VELOCITY_KI.type, reg.VELOCITY_KI.param): struct.pack("<f", 0.0),
            (reg.VELOCITY_KD.type, reg.VELOCITY_KD.param): struct.pack("<f", 0.0),
            (reg.INPUT_FILTER.type, reg.INPUT_FILTER.param): struct.pack("<I", 1000),
            (reg.FIRMWARE.type, reg.FIRMWARE.param): struct.pack("<I", 1),
            (reg.VELOCITY_FF1.type, reg.VELOCITY_FF1.param): struct.pack("<f", 0.0258),
        }

    @property
    def asked_s(self) -> float:
        """When the newest valid message came [s]."""
        return self._fed

    @property
    def timeout_s(self) -> float:
        """The module's own watchdog."""
        return float(struct.unpack("<f", self.written[reg.TIMEOUT.type, reg.TIMEOUT.param])[0])

    def move(self) -> None:
        """Bring the rotor to the present."""
        now = self.clock()
        dt, self._time = now - self._time, now
        if self.mode in DRIVEN_MODES and now - self._fed > self.timeout_s:
            self.mode, self.commanded = reg.COAST, 0.0
            self.timeouts += 1
        target = self.commanded if self.mode == VELOCITY_MODE else 0.0
        if self.jammed:
            self.velocity = 0.0
        else:
            self.velocity += (target - self.velocity) * (1.0 - math.exp(-dt / self.lag_s))
        self.angle += self.velocity * dt

    def feed(self, data: bytes) -> bytes:
        """Take bytes; the replies to the messages in them."""
        return b"".join(self._handle(message) for message in self._parser.feed(data))

    def _handle(self, message: Message) -> bytes:
        if message.module != self.module:
            return b""
        self._fed = self.clock()
        self.log.append(message)
        if message.access == SET:
            self._set(message)
        return self._answer(message) if message.access == GET else b""

    def _set(self, message: Message) -> None:
        address = (message.type, message.param)
        if address == (reg.CTRL_VELOCITY.type, reg.CTRL_VELOCITY.param):
            self.mode, self.commanded = VELOCITY_MODE, struct.unpack("<f", message.data)[0]
            self.commanded_at = self.commanded_at[-COMMANDS_KEPT:]
            self.commanded_at.append((self._fed, self.commanded))
        elif address == (reg.CTRL_COAST.type, reg.CTRL_COAST.param):
            self.mode, self.commanded = reg.COAST, 0.0
        elif address == (reg.FAULT_EVER.type, reg.FAULT_EVER.param):
            self.faults_ever = message.data[0]
        elif address in self.written:
            self.written[address] = message.data

    def _answer(self, message: Message) -> bytes:
        address = (message.type, message.param)
        data = self.written.get(address) or self._readings().get(address)
        if data is None:
            return b""
        return self.mangle(encode(Message(message.type, message.param, REPLY, self.module, data)))

    def _readings(self) -> dict[tuple[int, int], bytes]:
        velocity, angle = self.frozen or (self.velocity, self.angle)
        wrapped = (angle + math.pi) % math.tau - math.pi
        uptime = int(self.clock() - self._booted)
        slow = (
            self.controller_c * 100,
            self.coil_c * 100,
            self.volts * 100,
            self.amps * 100,
            0,
            velocity,
        )
        return {
            (reg.OBS_VELOCITY.type, reg.OBS_VELOCITY.param): struct.pack("<f", velocity),
            (reg.OBS_ANGLE.type, reg.OBS_ANGLE.param): struct.pack("<f", wrapped),
            (reg.CTRL_MODE.type, reg.CTRL_MODE.param): struct.pack("<b", self.mode),
            (reg.FAULT_NOW.type, reg.FAULT_NOW.param): bytes([self.faults]),
            (reg.FAULT_EVER.type, reg.FAULT_EVER.param): bytes([self.faults_ever]),
            (reg.DERATE.type, reg.DERATE.param): struct.pack("<i", self._derate),
            (reg.TELEMETRY.type, reg.TELEMETRY.param): struct.pack("<6hI", *map(int, slow), uptime),
        }
