# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the rotor's own device says against moving: telemetry, its silence, motion against the command, forgotten set-up."""

from fish_hw.devices.rotor_guard import Phase
from fish_hw.devices.rotor_health import Health, RotorHealth
from fish_hw.devices.rotor_motion import MotionCheck
from fish_hw.devices.vertiq import RotorSample, RotorTelemetry, Vertiq
from fish_hw.devices.vertiq_registers import RESTING_MODES
from fish_hw.settings.rotor import RotorSettings

TELEMETRY_S = 0.1  # between two answered questions of one kind
AGAIN_S = 0.02  # until an unanswered question is asked again
FEWEST_QUESTIONS = 5  # unanswered before it is called silence: a stalled computer asks few


class Silence:
    """Unanswered questions of one kind in a row, and since when."""

    def __init__(self, name: str, timeout_s: float) -> None:
        self.name = name
        self._timeout_s = timeout_s
        self.restart()

    def restart(self) -> None:
        """Begin again."""
        self._since_s: float | None = None
        self._questions = 0

    def note(self, answered: bool, now: float) -> bool:
        """Take whether the question of `now` [s] was answered; whether the silence has lasted for too long."""
        if answered:
            self.restart()
            return False
        self._since_s = now if self._since_s is None else self._since_s
        self._questions += 1
        return self.lasts(now)

    def lasts(self, now: float) -> bool:
        """Whether the silence has lasted for too long."""
        return (
            self._since_s is not None
            and now - self._since_s >= self._timeout_s
            and self._questions >= FEWEST_QUESTIONS
        )


class RotorWatch:
    """Judges what the module answers; `troubles` are reasons to disarm that last as long as they are true."""

    def __init__(self, settings: RotorSettings) -> None:
        self.health = Health()
        self.judge = RotorHealth(settings)
        self.known = RotorTelemetry()  # newest known values
        self.answer = Silence("measured speed", settings.answer_timeout_s)
        self._motion = MotionCheck()
        self._power = Silence("battery and temperature", settings.telemetry_timeout_s)
        self._state = Silence("module faults", settings.telemetry_timeout_s)
        self._next = {"power": 0.0, "state": 0.5 * TELEMETRY_S}
        self._unwatched: list[str] = []

    def restart(self) -> None:
        """Begin again with a module that was connected again."""
        self.known = RotorTelemetry()
        self._unwatched = []
        for silence in (self.answer, self._power, self._state):
            silence.restart()
        self._motion.restart()

    @property
    def troubles(self) -> tuple[str, ...]:
        """Reasons to disarm."""
        silent = (f"no telemetry: {name} not answered" for name in self._unwatched)
        return (*self.health.stops, *silent)

    def rest(self) -> None:
        """The rotor is not driven: its motion says nothing."""
        self._motion.restart()

    def moves(self, command: float, sample: RotorSample) -> str:
        """What is wrong with the motion after a command [rad/s]; empty if nothing is."""
        return self._motion.add(command, sample)

    def ask(self, vertiq: Vertiq, now: float) -> RotorTelemetry | None:
        """Ask for what is due at `now` [s], one question a cycle, and judge it; None if nothing was due."""
        for kind, silence, question in (
            ("power", self._power, vertiq.power),
            ("state", self._state, vertiq.state),
        ):
            if now >= self._next[kind]:
                telemetry = question()
                value = telemetry.volts if kind == "power" else telemetry.faults
                silence.note(value is not None, now)
                self._next[kind] = now + (TELEMETRY_S if value is not None else AGAIN_S)
                self._unwatched = [s.name for s in (self._power, self._state) if s.lasts(now)]
                self.health = self.judge.judge(telemetry, now)
                return telemetry
        return None

    def forgotten(self, telemetry: RotorTelemetry, phase: Phase) -> str:
        """Whether the module forgot what it was told: it restarted, or drives while it is to rest; empty if not."""
        last_s, uptime_s = self.known.uptime_s, telemetry.uptime_s
        self.known = telemetry.completed(self.known)
        if last_s is not None and uptime_s is not None and uptime_s < last_s:
            return "the module restarted"
        if phase is Phase.RESTING and telemetry.mode not in (None, *RESTING_MODES):
            return "the module drove although it was told to coast"
        return ""
