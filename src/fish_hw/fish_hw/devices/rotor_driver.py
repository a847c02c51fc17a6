# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rotor as a whole: port, module, arming state, guard and watch, one cycle per step.

One thread calls step() and owns the port; commands and requests may come from other threads.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from fish_hw.devices.leak_sensor import LeakSensor
from fish_hw.devices.reconnect import ERROR, OK, WARN, DeviceError, Link, Status
from fish_hw.devices.rotor_guard import Action, RotorGuard
from fish_hw.devices.rotor_watch import RotorWatch
from fish_hw.devices.vertiq import NoAnswer, RotorSample, RotorTelemetry, Vertiq
from fish_hw.devices.vertiq_search import explain
from fish_hw.protocol.iquart import fault_names
from fish_hw.settings import RotorSettings
from fish_hw.transport.interfaces import ByteStream, TransportError
from fish_node.arming import Arming, Source, operator_and_estimate

COMMAND, RUDDER = "joint_command", "word of the rudder"  # sources of the arming state
MISTAKEN_SPEED = 1000.0  # rad/s; a faster command is a mistake
MODULE, LEAK = "rotor module", "leak sensor"


def sources(settings: RotorSettings) -> tuple[Source, ...]:
    """What must be well while the robot is armed; troubles without a timeout are added as they are heard."""
    rudder = (Source(RUDDER, settings.rudder_timeout_s),) if settings.rudder_timeout_s else ()
    return (
        Source(MODULE, settings.module_timeout_s),
        Source(COMMAND, settings.stale_s),
        *rudder,
        *operator_and_estimate(settings),
    )


@dataclass
class RotorCycle:
    """What one step brought: measurement, slow values, and events worth a line in the log."""

    sample: RotorSample | None = None
    telemetry: RotorTelemetry | None = None
    events: list[str] = field(default_factory=list)


class RotorDriver:
    """Drives the module while the robot is armed; finds it again after it was lost.

    Attributes:
        arming: the arming state of the robot, which this driver owns.
        rejected: commands that were no finite numbers.

    Args:
        settings: of the rotor.
        open_stream: opens the port as the settings say.
        clock: s, monotonic.
        leak: sensor of water in the hull, if there is one.
        open_at: opens the port at a baud rate, to find out why nobody answers.
    """

    def __init__(
        self,
        settings: RotorSettings,
        open_stream: Callable[[], ByteStream],
        clock: Callable[[], float] = time.monotonic,
        leak: LeakSensor | None = None,
        open_at: Callable[[int], ByteStream] | None = None,
    ) -> None:
        self.arming = Arming(sources(settings))
        self.guard = RotorGuard(settings)
        self.rejected = 0
        self._settings = settings
        self._open_stream = open_stream
        self._clock = clock
        self._leak, self._leaks = leak, ""
        self._open_at = open_at
        self._lock = threading.Lock()  # of the guard: commands arrive on another thread
        self._stream: ByteStream | None = None
        self._vertiq: Vertiq | None = None
        self._link = Link("rotor")
        self._watch = RotorWatch(settings)
        self._clear_faults = threading.Event()
        self._found: list[str] = []  # what connect() learned; said when the module is known to work
        self._events: list[str] = []

    @property
    def connected(self) -> bool:
        """Whether the module answers."""
        return self._vertiq is not None

    def connect(self) -> None:
        """Open the port, coast the module and set its watchdog; PortUnavailable or DeviceError if it
        cannot.
        """
        settings = self._settings
        self._stream = self._open_stream()
        try:
            vertiq = Vertiq(
                self._stream,
                settings.module_id,
                settings.sign,
                settings.reply_timeout_s,
                self._clock,
            )
            vertiq.coast()
            found = vertiq.configure(settings.module_timeout_s)
            tuning = ", ".join(f"{name} {value:g}" for name, value in vertiq.tuning().items())
        except NoAnswer as error:
            self._stream.close()
            raise DeviceError(f"{settings.port}: {error}: {self._explained()}") from error
        except DeviceError as error:
            self._stream.close()
            raise DeviceError(f"{settings.port}: {error}") from error
        except TransportError:
            self._stream.close()
            raise
        self._vertiq = vertiq
        self._watch.restart()
        self._found = [*found, f"rotor module {settings.module_id} on {settings.port}: {tuning}"]

    def _explained(self) -> str:
        """What is there instead of the module."""
        settings, found = self._settings, ""
        if self._open_at is not None:
            found = explain(self._open_at, settings.baud, settings.module_id, self._clock)
        return found or "check its power, wiring, baud rate and module_id"

    def command(self, velocity: float | None) -> None:
        """Take a commanded speed [rad/s]; None stands for a message without one, which does not count as a command.

        A number that is none, or that no controller means, disarms.
        """
        if velocity is None or not abs(velocity) <= MISTAKEN_SPEED:
            self.rejected += 1
            if velocity is not None:
                self.arming.disarm(
                    f"commanded speed is {velocity:g} rad/s, expected {MISTAKEN_SPEED:g} rad/s at most"
                )
            return
        with self._lock:
            self.guard.command(velocity)
        self.arming.heard(COMMAND, self._clock())

    def clear_faults(self) -> None:
        """Clear the module's fault memory in the next cycle."""
        self._clear_faults.set()

    def step(self) -> RotorCycle:
        """One cycle: decide, command, measure."""
        now = self._clock()
        if self._leak is not None:
            self._leaks = self._leak.trouble(now)
            self.arming.heard(LEAK, now, self._leaks)
        cycle = RotorCycle()
        try:
            if self._vertiq is None:
                self._reconnect(now)
            else:
                self._cycle(self._vertiq, now, cycle)
        except (TransportError, DeviceError) as error:
            self._lose(str(error), now)
        cycle.events, self._events = self._events, []
        return cycle

    def close(self) -> None:
        """Coast and give port and leak sensor back."""
        if self._leak is not None:
            self._leak.close()
        self._release()

    def status(self) -> Status:
        """State in one line with counters."""
        values: dict[str, object] = {
            "phase": self.guard.phase.value,
            "armed": self.arming.armed,
            "reason": self.arming.reason,
            "rejected commands": self.rejected,
            "clamped commands": self.guard.clamped,
            "reconnect attempts": self._link.attempts,
        }
        vertiq, leaks = self._vertiq, (self._leaks,) if self._leaks else ()
        if vertiq is None:
            return Status(ERROR, "; ".join((*leaks, self._link.trouble)), values)
        values |= self._line_values(vertiq)
        if troubles := (*leaks, *self._watch.troubles):
            return Status(ERROR, "; ".join(troubles), values)
        if self._watch.health.warnings:
            return Status(WARN, "; ".join(self._watch.health.warnings), values)
        if not self.arming.armed:
            return Status(WARN, f"disarmed: {self.arming.reason}", values)
        return Status(OK, self.guard.phase.value, values)

    def _cycle(self, vertiq: Vertiq, now: float, cycle: RotorCycle) -> None:
        self.arming.heard(MODULE, now, "; ".join(self._watch.troubles))
        armed = self.arming.check(now)
        with self._lock:
            before, action = self.guard.phase, self.guard.step(now, armed)
        if self.guard.phase is not before:
            because = f" ({self.arming.reason})" if self.arming.reason else ""
            self._events.append(f"rotor {self.guard.phase.value}{because}")
        cycle.sample = self._perform(vertiq, action)
        if action.ask:
            self._judge_answer(action, cycle.sample, now)
            self._ask_more(vertiq, now, cycle)
        else:
            self._watch.answer.restart()

    def _perform(self, vertiq: Vertiq, action: Action) -> RotorSample | None:
        if action.coast:
            vertiq.coast()
        elif action.velocity is not None and action.ask:
            return vertiq.drive(action.velocity)
        elif action.velocity is not None:
            vertiq.command(action.velocity)
        elif action.ask:
            return vertiq.measure()
        return None

    def _judge_answer(self, action: Action, sample: RotorSample | None, now: float) -> None:
        """Silence gives the module up; motion that is not the commanded one disarms."""
        if self._watch.answer.note(sample is not None, now):
            raise DeviceError(
                f"{self._settings.port}: module {self._settings.module_id} stopped answering"
            )
        if sample is None:
            return
        self._events += [*self._found, *self._link.works()]
        self._found = []
        if action.velocity is None:
            self._watch.rest()
        elif wrong := self._watch.moves(action.velocity, sample):
            self.arming.disarm(wrong)

    def _ask_more(self, vertiq: Vertiq, now: float, cycle: RotorCycle) -> None:
        """Telemetry and what the operator asked for, only while the module may be asked: questions feed its watchdog."""
        if self._clear_faults.is_set():
            self._clear_module_faults(vertiq)
        cycle.telemetry = self._watch.ask(vertiq, now)
        if cycle.telemetry is None:
            return
        if forgotten := self._watch.forgotten(cycle.telemetry, self.guard.phase):
            vertiq.coast()
            self._cut(forgotten, now)
            self._events.append(f"rotor coasts: {forgotten}")
            vertiq.configure(self._settings.module_timeout_s)

    def _cut(self, reason: str, now: float) -> None:
        self.arming.disarm(reason)
        self._watch.rest()
        with self._lock:
            self.guard.cut(now)

    def _reconnect(self, now: float) -> None:
        self.arming.heard(MODULE, now, self._link.trouble)
        if self._link.due(now):
            self.connect()

    def _lose(self, reason: str, now: float) -> None:
        self._events += self._link.lose(reason, now)
        self._release()
        self._link.trouble = reason
        self.arming.heard(MODULE, now, reason)
        self._cut(reason, now)

    def _release(self) -> None:
        if self._stream is None:
            return
        try:
            if self._vertiq is not None:
                self._vertiq.coast()
        except TransportError:
            self._link.trouble = "the port was gone before the rotor could be told to coast"
        self._stream.close()
        self._stream = self._vertiq = None

    def _clear_module_faults(self, vertiq: Vertiq) -> None:
        self._clear_faults.clear()
        ever = vertiq.clear_faults()
        if ever is None:
            self._events.append("fault memory not cleared: the module did not say what it holds")
            return
        self._events.append(
            f"fault memory cleared; it held: {', '.join(fault_names(ever)) or 'none'}"
        )

    def _line_values(self, vertiq: Vertiq) -> dict[str, object]:
        values: dict[str, object] = {
            "reply timeouts": vertiq.counters.timeouts,
            "unexpected messages": vertiq.counters.unexpected,
            "crc errors": vertiq.parser.crc_errors,
            "skipped bytes": vertiq.parser.skipped_bytes,
            "filtered volts": round(self._watch.judge.filtered_volts, 2),
        }
        return values | {
            name: value for name, value in vars(self._watch.known).items() if value is not None
        }
