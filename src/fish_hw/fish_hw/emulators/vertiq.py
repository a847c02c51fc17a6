# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A Vertiq 40-06 (speed firmware) made of software: bytes in, bytes out, on any clock, also behind a pseudo-terminal.

The rotor follows its command with a first-order lag. As in the real module any valid message feeds the timeout. Through the
pseudo-terminal the real driver talks to it through a real port. A module waits for nobody: replies that nobody takes are
lost.
"""

import contextlib
import math
import os
import pty
import select
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable

from fish_hw.emulators import int16
from fish_hw.protocol import iquart
from fish_hw.protocol.iquart import GET, REPLY, SET, Message, Parser, encode

VELOCITY_MODE = 4
DRIVEN_MODES = (2, 3, VELOCITY_MODE)
COMMANDS_KEPT = 100_000

POLL_S = 0.02
OUTPUT_SPEED = 5  # index in termios.tcgetattr
NOISE = b"\xf8\x00\xfe"  # what bytes at another speed look like


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
        self.mode = iquart.COAST
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
        self._derate = iquart.DERATE_NONE
        self._time = self._fed = self._booted = clock()
        self._parser = Parser()
        self.reboot()

    def reboot(self) -> None:
        """Brown-out: back to the saved settings, resting."""
        self._booted = self.clock()
        self.mode, self.commanded = iquart.COAST, 0.0
        self.written = {
            (iquart.TIMEOUT.type, iquart.TIMEOUT.param): struct.pack("<f", 1.0),
            (iquart.TIMEOUT_BEHAVIOR.type, iquart.TIMEOUT_BEHAVIOR.param): b"\x00",
            (iquart.TIMEOUT_MEANING.type, iquart.TIMEOUT_MEANING.param): b"\x00",
            (iquart.TIMEOUT_SONG.type, iquart.TIMEOUT_SONG.param): b"\x02",
            (iquart.VELOCITY_KP.type, iquart.VELOCITY_KP.param): struct.pack("<f", 0.02),
            (iquart.VELOCITY_KI.type, iquart.VELOCITY_KI.param): struct.pack("<f", 0.0),
            (iquart.VELOCITY_KD.type, iquart.VELOCITY_KD.param): struct.pack("<f", 0.0),
            (iquart.INPUT_FILTER.type, iquart.INPUT_FILTER.param): struct.pack("<I", 1000),
            (iquart.FIRMWARE.type, iquart.FIRMWARE.param): struct.pack("<I", 1),
            (iquart.VELOCITY_FF1.type, iquart.VELOCITY_FF1.param): struct.pack("<f", 0.0258),
        }

    @property
    def asked_s(self) -> float:
        """When the newest valid message came [s]."""
        return self._fed

    @property
    def timeout_s(self) -> float:
        """The module's own watchdog."""
        return float(
            struct.unpack("<f", self.written[iquart.TIMEOUT.type, iquart.TIMEOUT.param])[0]
        )

    def move(self) -> None:
        """Bring the rotor to the present."""
        now = self.clock()
        dt, self._time = now - self._time, now
        if self.mode in DRIVEN_MODES and now - self._fed > self.timeout_s:
            self.mode, self.commanded = iquart.COAST, 0.0
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
        if address == (iquart.CTRL_VELOCITY.type, iquart.CTRL_VELOCITY.param):
            self.mode, self.commanded = VELOCITY_MODE, struct.unpack("<f", message.data)[0]
            self.commanded_at = self.commanded_at[-COMMANDS_KEPT:]
            self.commanded_at.append((self._fed, self.commanded))
        elif address == (iquart.CTRL_COAST.type, iquart.CTRL_COAST.param):
            self.mode, self.commanded = iquart.COAST, 0.0
        elif address == (iquart.FAULT_EVER.type, iquart.FAULT_EVER.param):
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
            (iquart.OBS_VELOCITY.type, iquart.OBS_VELOCITY.param): struct.pack("<f", velocity),
            (iquart.OBS_ANGLE.type, iquart.OBS_ANGLE.param): struct.pack("<f", wrapped),
            (iquart.CTRL_MODE.type, iquart.CTRL_MODE.param): struct.pack("<b", self.mode),
            (iquart.FAULT_NOW.type, iquart.FAULT_NOW.param): bytes([self.faults]),
            (iquart.FAULT_EVER.type, iquart.FAULT_EVER.param): bytes([self.faults_ever]),
            (iquart.DERATE.type, iquart.DERATE.param): struct.pack("<i", self._derate),
            (iquart.TELEMETRY.type, iquart.TELEMETRY.param): struct.pack(
                "<6hI", *map(int16, slow), uptime
            ),
        }


class VertiqEmulator(VertiqModule):
    """Runs on its own thread until close(); `port` is what the driver opens.

    Args:
        module: module id it answers to.
        lag_s: time constant of the rotor.
        speed: speed constant of termios that it runs at; a port that is set to another one reads noise. None: any.
        clock: s, by which the rotor turns.
    """

    def __init__(
        self,
        module: int = 0,
        lag_s: float = 0.01,
        speed: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._speed = speed
        super().__init__(module, lag_s, clock)
        self._moving = threading.RLock()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and take the port away, as pulling the plug does; may be called twice."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def move(self) -> None:
        """As VertiqModule's; any thread may ask."""
        with self._moving:
            super().move()

    def _understands(self) -> bool:
        return self._speed is None or termios.tcgetattr(self._master)[OUTPUT_SPEED] == self._speed

    def _run(self) -> None:
        while not self._stop.is_set():
            readable, _, _ = select.select([self._master], [], [], POLL_S)
            self.move()
            if readable:
                data = os.read(self._master, 512)
                with self._moving:
                    replies = self.feed(data) if self._understands() else NOISE
                with contextlib.suppress(BlockingIOError):
                    os.write(self._master, replies)
