"""A Vertiq 40-06 (speed firmware) behind a pseudo-terminal: the real driver talks to it through a real port.

The rotor follows its command with a first-order lag. As in the real module any valid message feeds the
timeout.
"""

import math
import os
import pty
import select
import struct
import threading
import time
import tty
from collections.abc import Callable

from fish_hw.devices import vertiq_registers as reg
from fish_hw.protocol.iquart import GET, REPLY, SET, Message, Parser, encode

POLL_S = 0.002
VELOCITY_MODE = 4
DRIVEN_MODES = (2, 3, VELOCITY_MODE)


class VertiqEmulator:
    """Runs on its own thread until close(); `port` is what the driver opens.

    Args:
        module: module id it answers to.
        lag_s: time constant of the rotor.
    """

    def __init__(self, module: int = 0, lag_s: float = 0.01) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.module, self.lag_s = module, lag_s
        self.velocity = self.commanded = self.angle = 0.0
        self.mode = reg.COAST
        self.jammed = False
        self.timeouts = 0
        self.volts, self.amps, self.controller_c, self.coil_c = 14.8, 0.5, 35.0, 40.0
        self.faults = self.faults_ever = 0
        self.log: list[Message] = []
        self.mangle: Callable[[bytes], bytes] = lambda reply: reply  # a test's way to break replies
        self.written: dict[tuple[int, int], bytes] = {}
        self._derate = reg.DERATE_NONE
        self._time = self._fed = self._booted = time.monotonic()
        self._parser = Parser()
        self._stop = threading.Event()
        self._boot()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def reboot(self) -> None:
        """Brown-out: back to the saved settings, resting."""
        self._boot()

    def close(self) -> None:
        """Stop and take the port away, as pulling the plug does; may be called twice."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def _boot(self) -> None:
        self._booted = time.monotonic()
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
    def timeout_s(self) -> float:
        """The module's own watchdog."""
        return float(struct.unpack("<f", self.written[reg.TIMEOUT.type, reg.TIMEOUT.param])[0])

    def _run(self) -> None:
        while not self._stop.is_set():
            readable, _, _ = select.select([self._master], [], [], POLL_S)
            self._move()
            if readable:
                for message in self._parser.feed(os.read(self._master, 512)):
                    self._handle(message)

    def _move(self) -> None:
        now = time.monotonic()
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

    def _handle(self, message: Message) -> None:
        if message.module != self.module:
            return
        self._fed = time.monotonic()
        self.log.append(message)
        if message.access == SET:
            self._set(message)
        elif message.access == GET:
            self._answer(message)

    def _set(self, message: Message) -> None:
        address = (message.type, message.param)
        if address == (reg.CTRL_VELOCITY.type, reg.CTRL_VELOCITY.param):
            self.mode, self.commanded = VELOCITY_MODE, struct.unpack("<f", message.data)[0]
        elif address == (reg.CTRL_COAST.type, reg.CTRL_COAST.param):
            self.mode, self.commanded = reg.COAST, 0.0
        elif address == (reg.FAULT_EVER.type, reg.FAULT_EVER.param):
            self.faults_ever = message.data[0]
        elif address in self.written:
            self.written[address] = message.data

    def _answer(self, message: Message) -> None:
        address = (message.type, message.param)
        data = self.written.get(address) or self._readings().get(address)
        if data is None:
            return
        reply = encode(Message(message.type, message.param, REPLY, self.module, data))
        mangled = self.mangle(reply)
        if mangled:
            os.write(self._master, mangled)

    def _readings(self) -> dict[tuple[int, int], bytes]:
        wrapped = (self.angle + math.pi) % math.tau - math.pi
        uptime = int(time.monotonic() - self._booted)
        slow = (
            self.controller_c * 100,
            self.coil_c * 100,
            self.volts * 100,
            self.amps * 100,
            0,
            self.velocity,
        )
        return {
            (reg.OBS_VELOCITY.type, reg.OBS_VELOCITY.param): struct.pack("<f", self.velocity),
            (reg.OBS_ANGLE.type, reg.OBS_ANGLE.param): struct.pack("<f", wrapped),
            (reg.CTRL_MODE.type, reg.CTRL_MODE.param): struct.pack("<b", self.mode),
            (reg.FAULT_NOW.type, reg.FAULT_NOW.param): bytes([self.faults]),
            (reg.FAULT_EVER.type, reg.FAULT_EVER.param): bytes([self.faults_ever]),
            (reg.DERATE.type, reg.DERATE.param): struct.pack("<i", self._derate),
            (reg.TELEMETRY.type, reg.TELEMETRY.param): struct.pack("<6hI", *map(int, slow), uptime),
        }
