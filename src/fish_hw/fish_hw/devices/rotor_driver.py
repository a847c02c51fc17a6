"""The rotor as a whole: port, module, guard and health, one cycle per step.

One thread calls step() and owns the port; commands and requests may come from other threads.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from fish_hw.devices.errors import DeviceError
from fish_hw.devices.reconnect import Link
from fish_hw.devices.rotor_guard import Action, Phase, RotorGuard
from fish_hw.devices.rotor_health import Health, RotorHealth
from fish_hw.devices.status import ERROR, OK, WARN, Status
from fish_hw.devices.vertiq import RotorSample, RotorTelemetry, Vertiq
from fish_hw.devices.vertiq_registers import RESTING_MODES, fault_names
from fish_hw.settings.rotor import RotorSettings
from fish_hw.transport.errors import TransportError
from fish_hw.transport.interfaces import ByteStream

SILENCE_S = 0.5  # unanswered questions for this long, and at least
SILENT_QUESTIONS = 5  # of them (a stalled computer asks few), mean that the module is gone
TELEMETRY_S = 0.2
UNWATCHED_QUESTIONS = (
    10  # for telemetry, 2 s of asking; without an answer nobody protects battery and rotor
)


@dataclass
class RotorCycle:
    """What one step brought: measurement, slow values, and events worth a line in the log."""

    sample: RotorSample | None = None
    telemetry: RotorTelemetry | None = None
    events: list[str] = field(default_factory=list)


class RotorDriver:
    """Drives the module as the guard allows; finds it again after it was lost."""

    def __init__(
        self,
        settings: RotorSettings,
        open_stream: Callable[[], ByteStream],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.guard = RotorGuard(settings)
        self._settings = settings
        self._open_stream = open_stream
        self._clock = clock
        self._lock = threading.Lock()  # of the guard: commands arrive on another thread
        self._stream: ByteStream | None = None
        self._vertiq: Vertiq | None = None
        self._link = Link("rotor")
        self._silent_since: float | None = None
        self._silent_questions = 0
        self._telemetry = RotorTelemetry()  # newest known values
        self._telemetry_time = 0.0
        self._unanswered = {"battery and temperature": 0, "module faults": 0}  # questions in a row
        self._judge = RotorHealth(settings)
        self._health = Health()
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
        except DeviceError as error:
            self._stream.close()
            raise DeviceError(f"{settings.port}: {error}") from error
        except TransportError:
            self._stream.close()
            raise
        self._vertiq = vertiq
        self._telemetry = RotorTelemetry()
        self._unanswered = dict.fromkeys(self._unanswered, 0)
        self._silent_since = None
        self._silent_questions = 0
        self._found = [*found, f"rotor module {settings.module_id} on {settings.port}: {tuning}"]

    def command(self, velocity: float) -> None:
        """Take a commanded speed [rad/s]."""
        with self._lock:
            self.guard.command(velocity, self._clock())

    def enable(self) -> None:
        """The operator ends a stop."""
        with self._lock:
            self.guard.enable()

    def stop(self, reason: str) -> None:
        """The operator stops the rotor, until enable()."""
        with self._lock:
            self.guard.stop(reason, hold=True)

    def clear_faults(self) -> None:
        """Clear the module's fault memory in the next cycle."""
        self._clear_faults.set()

    def step(self) -> RotorCycle:
        """One cycle: decide, command, measure."""
        now = self._clock()
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
        """Coast and give the port back."""
        if self._stream is None:
            return
        try:
            if self._vertiq is not None:
                self._vertiq.coast()
        except TransportError:
            self._link.trouble = "the port was gone before the rotor could be told to coast"
        self._stream.close()
        self._stream = self._vertiq = None

    def status(self) -> Status:
        """State in one line with counters."""
        values: dict[str, object] = {
            "phase": self.guard.phase.value,
            "latched": self.guard.latched,
            "reason": self.guard.reason,
            "rejected commands": self.guard.rejected,
            "clamped commands": self.guard.clamped,
            "reconnect attempts": self._link.attempts,
        }
        vertiq = self._vertiq
        if vertiq is None:
            return Status(ERROR, self._link.trouble, values)
        values |= self._line_values(vertiq)
        unwatched = [
            name for name, missed in self._unanswered.items() if missed >= UNWATCHED_QUESTIONS
        ]
        if self._health.stops:
            return Status(ERROR, "; ".join(self._health.stops), values)
        if unwatched:
            return Status(ERROR, f"no telemetry: {' and '.join(unwatched)} are not watched", values)
        if self._health.warnings:
            return Status(WARN, "; ".join(self._health.warnings), values)
        if self.guard.latched:
            return Status(WARN, f"stopped: {self.guard.reason}", values)
        return Status(OK, self.guard.phase.value, values)

    def _cycle(self, vertiq: Vertiq, now: float, cycle: RotorCycle) -> None:
        with self._lock:
            before, action = self.guard.phase, self.guard.step(now, self._health.stops)
        self._note_phase(before)
        cycle.sample = self._perform(vertiq, action)
        self._watch_silence(action.ask, cycle.sample is not None, now)
        if cycle.sample is not None:
            self._events += [*self._found, *self._link.works()]
            self._found = []
        if (
            action.ask and self._clear_faults.is_set()
        ):  # else the question would feed the module's watchdog
            self._clear_module_faults(vertiq)
        if action.ask and now - self._telemetry_time >= TELEMETRY_S:
            self._telemetry_time = now
            cycle.telemetry = vertiq.telemetry()
            self._check(vertiq, cycle.telemetry, now)

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

    def _watch_silence(self, asked: bool, answered: bool, now: float) -> None:
        if answered or not asked:
            self._silent_since = None
            self._silent_questions = 0
            return
        self._silent_since = now if self._silent_since is None else self._silent_since
        self._silent_questions += 1
        if now - self._silent_since > SILENCE_S and self._silent_questions >= SILENT_QUESTIONS:
            raise DeviceError(
                f"{self._settings.port}: module {self._settings.module_id} stopped answering"
            )

    def _check(self, vertiq: Vertiq, telemetry: RotorTelemetry, now: float) -> None:
        """Health, and the two ways in which a module forgets what it was told."""
        self._health = self._judge.judge(telemetry, now)
        self._count_unanswered(telemetry)
        last_s, uptime_s = self._telemetry.uptime_s, telemetry.uptime_s
        self._telemetry = telemetry.completed(self._telemetry)
        if last_s is not None and uptime_s is not None and uptime_s < last_s:
            self._cut(vertiq, "the module restarted", now)
            vertiq.configure(self._settings.module_timeout_s)
        elif self.guard.phase is Phase.RESTING and telemetry.mode not in (None, *RESTING_MODES):
            self._cut(vertiq, "the module drove although it was told to coast", now)

    def _count_unanswered(self, telemetry: RotorTelemetry) -> None:
        answers = {"battery and temperature": telemetry.volts, "module faults": telemetry.faults}
        for name, answer in answers.items():
            self._unanswered[name] = self._unanswered[name] + 1 if answer is None else 0

    def _cut(self, vertiq: Vertiq, reason: str, now: float) -> None:
        vertiq.coast()
        with self._lock:
            self.guard.cut(reason, now)
        self._events.append(f"rotor coasts: {reason}")

    def _reconnect(self, now: float) -> None:
        if self._link.due(now):
            self.connect()

    def _lose(self, reason: str, now: float) -> None:
        self._events += self._link.lose(reason, now)
        self.close()
        self._link.trouble = reason
        with self._lock:
            self.guard.cut(reason, now)

    def _clear_module_faults(self, vertiq: Vertiq) -> None:
        self._clear_faults.clear()
        ever = vertiq.clear_faults()
        if ever is None:
            self._events.append("fault memory not cleared: the module did not say what it holds")
            return
        self._events.append(
            f"fault memory cleared; it held: {', '.join(fault_names(ever)) or 'none'}"
        )

    def _note_phase(self, before: Phase) -> None:
        if self.guard.phase is not before:
            because = f" ({self.guard.reason})" if self.guard.reason else ""
            self._events.append(f"rotor {self.guard.phase.value}{because}")

    def _line_values(self, vertiq: Vertiq) -> dict[str, object]:
        values: dict[str, object] = {
            "reply timeouts": vertiq.counters.timeouts,
            "unexpected messages": vertiq.counters.unexpected,
            "crc errors": vertiq.parser.crc_errors,
            "skipped bytes": vertiq.parser.skipped_bytes,
            "filtered volts": round(self._judge.filtered_volts, 2),
        }
        return values | {
            name: value for name, value in vars(self._telemetry).items() if value is not None
        }
