# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A Vertiq 40-06 motor module behind an IQUART port: write, read back, measure, coast.

The module answers `get` only, and its replies carry no number: replies are matched by register and module,
what lies in the port before a question is thrown away, and after an unanswered question the next one waits
for a moment, so that a late reply is not taken for the answer to the next question.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

from fish_hw.devices.reconnect import DeviceError
from fish_hw.protocol import iquart
from fish_hw.protocol.iquart import REPLY, Message, Parser, Register, encode
from fish_hw.transport.interfaces import ByteStream

COAST_REPEATS = 3  # a lost byte must not keep the rotor spinning
CONFIGURE_TRIES = 3
DRAIN_READS = 8
MOST_VALUE = (
    1e4  # rad/s or rad; a rotor turns with hundreds, and the module gives angles within +-pi
)
MOST_READS = 200  # for the answers of one exchange, on a clock that stands still


class NoAnswer(DeviceError):
    """Nobody answers to the module's id."""


@dataclass(frozen=True)
class RotorSample:
    """Angle [rad, continuous], speed [rad/s], counter-clockwise positive, and when [s, monotonic clock]."""

    time_s: float
    angle: float
    velocity: float


@dataclass(frozen=True)
class RotorTelemetry:
    """Slow values of the module; temperatures in deg C, derate 0 to 1 (1: full power), uptime in s.

    None stands where the module did not answer.
    """

    controller_c: float | None = None
    coil_c: float | None = None
    volts: float | None = None
    amps: float | None = None
    uptime_s: float | None = None
    faults: int | None = None
    derate: float | None = None
    mode: int | None = None

    def completed(self, older: "RotorTelemetry") -> "RotorTelemetry":
        """These values, and older ones where an answer is missing."""
        names = [field.name for field in fields(self)]
        values = {name: getattr(self, name) for name in names}
        return RotorTelemetry(
            **{n: getattr(older, n) if v is None else v for n, v in values.items()}
        )


@dataclass
class LinkCounters:
    """What went wrong on the line since the start."""

    timeouts: int = 0
    unexpected: int = 0  # late replies, other modules, echoes of our own bytes


class Vertiq:
    """One module on a port; sign -1 mirrors angle and speed."""

    def __init__(
        self,
        stream: ByteStream,
        module: int = 0,
        sign: int = 1,
        reply_timeout_s: float = 0.008,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.counters = LinkCounters()
        self.parser = Parser()
        self._stream = stream
        self._module = module
        self._sign = sign
        self._reply_timeout_s = reply_timeout_s
        self._clock = clock
        self._unanswered = False
        self._derate_tries = 0  # unanswered in a row, although the rest was answered
        self._asked_s = 0.0  # when the newest question went out
        self._last: RotorSample | None = None

    def drive(self, velocity: float) -> RotorSample | None:
        """Command a speed [rad/s] and measure, in one exchange; None if the answer is missing."""
        return self._measure([iquart.CTRL_VELOCITY.set(self._module, self._sign * velocity)])

    def command(self, velocity: float) -> None:
        """Command a speed [rad/s] without a question."""
        self._stream.write(encode(iquart.CTRL_VELOCITY.set(self._module, self._sign * velocity)))

    def measure(self) -> RotorSample | None:
        """Measure without a command."""
        return self._measure([])

    def coast(self) -> None:
        """Let the rotor run out, said several times."""
        self._stream.write(encode(iquart.CTRL_COAST.set(self._module)) * COAST_REPEATS)

    def clear_faults(self) -> int | None:
        """Clear the fault memory and return what was in it; None, and nothing cleared, if the module did not
        answer.
        """
        (ever,) = self.read(iquart.FAULT_EVER)
        if ever is None:
            return None
        self._stream.write(encode(iquart.FAULT_EVER.set(self._module, 0)))
        return int(ever[0])

    def power(self) -> RotorTelemetry:
        """Battery, temperatures and time since the module's start, if it answers."""
        (slow,) = self.read(iquart.TELEMETRY)
        if slow is None:
            return RotorTelemetry()
        controller, coil, volts, amps, _, _, uptime = slow
        return RotorTelemetry(controller / 100, coil / 100, volts / 100, amps / 100, uptime)

    def state(self) -> RotorTelemetry:
        """Faults, control mode and derating, as far as the module answers."""
        asked = (iquart.FAULT_NOW, iquart.CTRL_MODE, iquart.DERATE)
        faults, mode, derate = (*self.read(*asked[: 3 if self._has_derate else 2]), None)[:3]
        if faults is not None and mode is not None:
            self._derate_tries = 0 if derate is not None else self._derate_tries + 1
        values: dict[str, Any] = {}
        if faults is not None:
            values["faults"] = int(faults[0])
        if derate is not None:
            values["derate"] = derate[0] / iquart.DERATE_NONE
        if mode is not None:
            values["mode"] = int(mode[0])
        return RotorTelemetry(**values)

    @property
    def _has_derate(self) -> bool:
        """Some firmware has no such register; to wait for its answer for ever would cost time."""
        return self._derate_tries < CONFIGURE_TRIES

    def configure(self, timeout_s: float) -> list[str]:
        """Set the module's own watchdog (coast, no error, no song) and read it back; nothing is saved in the
        module.

        Returns:
            warnings: settings that this firmware does not have.

        Raises:
            NoAnswer: the module does not answer.
            DeviceError: it refuses the timeout.
        """
        verified = self._verified(iquart.TIMEOUT, timeout_s)
        if verified is None:
            raise NoAnswer(
                f"no Vertiq module {self._module} answers ({self.parser.skipped_bytes} bytes of noise,"
                f" {self.counters.unexpected} other messages)"
            )
        if not verified:
            raise DeviceError(f"module {self._module} refuses a timeout of {timeout_s} s")
        wanted = (
            (iquart.TIMEOUT_BEHAVIOR, 0),
            (iquart.TIMEOUT_MEANING, 0),
            (iquart.TIMEOUT_SONG, 0),
        )
        return [
            f"module does not take {r.name} = {v}" for r, v in wanted if not self._verified(r, v)
        ]

    def tuning(self) -> dict[str, float]:
        """Gains, filter and firmware version as the module has them, for the log."""
        found = {register.name: self.read(register)[0] for register in iquart.TUNING}
        return {name: value[0] for name, value in found.items() if value is not None}

    def read(self, *registers: Register) -> list[tuple[float, ...] | None]:
        """Values of registers, None where no answer came in time."""
        return self._exchange([], registers)

    def _verified(self, register: Register, value: float) -> bool | None:
        """Write and read back; True as written, False refused, None no answer."""
        answer = None
        for _ in range(CONFIGURE_TRIES):
            self._stream.write(encode(register.set(self._module, value)))
            (answer,) = self.read(register)
            if answer is not None and math.isclose(answer[0], value, rel_tol=1e-6, abs_tol=1e-6):
                return True
        return None if answer is None else False

    def _measure(self, commands: list[Message]) -> RotorSample | None:
        velocity, angle = self._exchange(commands, (iquart.OBS_VELOCITY, iquart.OBS_ANGLE))
        if velocity is None or angle is None:
            return None
        speed, wrapped = velocity[0], angle[0]
        if not (
            abs(speed) <= MOST_VALUE and abs(wrapped) <= MOST_VALUE
        ):  # nor NaN: the angle is kept
            self.counters.unexpected += 1
            return None
        time_s = (self._asked_s + self._clock()) / 2
        self._last = RotorSample(
            time_s, self._unwrap(self._sign * wrapped, time_s), self._sign * speed
        )
        return self._last

    def _unwrap(self, wrapped: float, time_s: float) -> float:
        """The angle that is nearest to where the last sample's speed leads; the module reports it within
        +-pi.
        """
        if self._last is None:
            return wrapped
        expected = self._last.angle + self._last.velocity * (time_s - self._last.time_s)
        return wrapped + math.tau * round((expected - wrapped) / math.tau)

    def _exchange(
        self, commands: list[Message], registers: Sequence[Register]
    ) -> list[tuple[float, ...] | None]:
        self._drain(0.0)
        if self._unanswered:  # the command must not wait, the question must
            self._send(commands)
            commands = []
            self._drain(self._reply_timeout_s)
        self._asked_s = self._clock()
        self._send([*commands, *(register.get(self._module) for register in registers)])
        answers = self._collect(registers)
        self._unanswered = len(answers) < len(registers)
        self.counters.timeouts += self._unanswered
        return [answers.get(register) for register in registers]

    def _send(self, messages: list[Message]) -> None:
        if messages:
            self._stream.write(b"".join(encode(message) for message in messages))

    def _drain(self, wait_s: float) -> None:
        """Throw away what came too late for the last exchange; bounded, a babbling line must not block a
        command.
        """
        for _ in range(DRAIN_READS):
            late = self._stream.read(wait_s)
            if not late:
                break
            self.counters.unexpected += len(self.parser.feed(late))
        self.counters.unexpected += len(self.parser.flush())

    def _collect(self, registers: Sequence[Register]) -> dict[Register, tuple[float, ...]]:
        wanted = {(register.type, register.param): register for register in registers}
        answers: dict[Register, tuple[float, ...]] = {}
        deadline = self._clock() + self._reply_timeout_s
        for _ in range(MOST_READS):
            left = deadline - self._clock()
            if len(answers) == len(wanted) or left <= 0:
                break
            self._take(self.parser.feed(self._stream.read(left)), wanted, answers)
        if len(answers) < len(wanted):
            self._take(self.parser.flush(), wanted, answers)
        return answers

    def _take(
        self,
        messages: list[Message],
        wanted: dict[tuple[int, int], Register],
        answers: dict[Register, tuple[float, ...]],
    ) -> None:
        for message in messages:
            register = wanted.get((message.type, message.param))
            ours = message.access == REPLY and message.module == self._module
            value = register.values(message.data) if register is not None and ours else None
            if register is None or value is None:
                self.counters.unexpected += 1
            else:
                answers[register] = value
