# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the rotor's own device says against moving: telemetry, its silence, motion against the command, forgotten set-up.

Motion is compared over windows: commanded way L_c = integral of |omega_c|, measured way L_m = sum of |delta theta|. It
shows a jam, a stuck encoder and a runaway.
"""

import math
from dataclasses import dataclass, field

from fish_hw.devices.rotor_guard import Phase
from fish_hw.devices.vertiq import RotorSample, RotorTelemetry, Vertiq
from fish_hw.protocol.iquart import RESTING_MODES, fault_names
from fish_hw.settings import RotorSettings

HIGH_ANSWERS = 2  # in a row with too high a voltage

WINDOW_S = 0.1  # shortest window; the module's velocity loop settles in some 0.02 s
WAY = 2.0  # rad, shortest commanded way that is judged
LEAST_SHARE = 0.3  # of the commanded way; a rotor with less is held
STUCK_SAMPLES = 10  # equal speeds in a row while the command changes
STUCK_CHANGE = 10.0  # rad/s, change of the command meanwhile
LONGEST_GAP_S = 0.065  # between samples; over a longer one a stroke of full throttle may turn half a turn unseen
MOST_GAPS = 30  # in a row, until nobody watches the rotor: two seconds or more
RUNAWAY = 60.0  # rad/s beyond every command of the last two windows

TELEMETRY_S = 0.1  # between two answered questions of one kind
AGAIN_S = 0.02  # until an unanswered question is asked again
FEWEST_QUESTIONS = 5  # unanswered before it is called silence: a stalled computer asks few


@dataclass(frozen=True)
class Health:
    """Reasons to warn and reasons to stop, in words; both empty when all is well."""

    warnings: tuple[str, ...] = field(default=())
    stops: tuple[str, ...] = field(default=())


class RotorHealth:
    """Judges telemetry.

    The battery is judged by its filtered voltage, v += (1 - exp(-dt / battery_filter_s)) (v_measured - v):
    the load ripples at 4 Hz. Once it stopped the rotor it must recover above the warning level. Too high a voltage stops
    it when two answers in a row say so: a single one may be the peak of a braking rotor.
    """

    def __init__(self, settings: RotorSettings) -> None:
        self.filtered_volts = math.nan
        self._settings = settings
        self._known = RotorTelemetry()
        self._last_time = 0.0
        self._battery_stopped = False
        self._high = 0  # answers in a row

    def judge(self, telemetry: RotorTelemetry, now: float) -> Health:
        """Warnings and stops for the newest telemetry; now in s.

        Where answers are missing the older ones hold: a stop does not end because the module fell silent.
        """
        if telemetry.volts is not None:
            self._filter(telemetry.volts, now)
            high = telemetry.volts / self._settings.battery_cells > self._settings.cell_over_v
            self._high = self._high + 1 if high else 0
        telemetry = self._known = telemetry.completed(self._known)
        warnings: list[str] = []
        stops: list[str] = []
        if telemetry.volts is not None:
            self._judge_battery(telemetry.volts, warnings, stops)
        self._judge_temperature(telemetry, warnings, stops)
        if telemetry.derate is not None and telemetry.derate < 1.0:
            warnings.append(f"module gives {telemetry.derate:.0%} of its power")
        if telemetry.faults:
            stops.append("module faults: " + ", ".join(fault_names(telemetry.faults)))
        return Health(tuple(warnings), tuple(stops))

    def _filter(self, volts: float, now: float) -> None:
        tau = self._settings.battery_filter_s
        if math.isnan(self.filtered_volts) or tau == 0.0:
            self.filtered_volts = volts
        else:
            gain = 1.0 - math.exp(-(now - self._last_time) / tau)
            self.filtered_volts += gain * (volts - self.filtered_volts)
        self._last_time = now

    def _judge_battery(self, volts: float, warnings: list[str], stops: list[str]) -> None:
        settings = self._settings
        cell = self.filtered_volts / settings.battery_cells
        limit = settings.cell_warn_v if self._battery_stopped else settings.cell_stop_v
        self._battery_stopped = cell < limit
        if self._battery_stopped:
            stops.append(f"battery at {cell:.2f} V per cell")
        elif cell < settings.cell_warn_v:
            warnings.append(f"battery at {cell:.2f} V per cell")
        if self._high:
            found = stops if self._high >= HIGH_ANSWERS else warnings
            found.append(f"battery driven up to {volts / settings.battery_cells:.2f} V per cell")

    def _judge_temperature(
        self, telemetry: RotorTelemetry, warnings: list[str], stops: list[str]
    ) -> None:
        for name, value in (("controller", telemetry.controller_c), ("coil", telemetry.coil_c)):
            if value is None:
                continue
            if value > self._settings.temperature_stop_c:
                stops.append(f"{name} at {value:.0f} deg C")
            elif value > self._settings.temperature_warn_c:
                warnings.append(f"{name} at {value:.0f} deg C")


class MotionCheck:
    """Judges samples against the commands that were sent for them."""

    def __init__(self) -> None:
        self._last: RotorSample | None = None
        self._before = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin again, when the rotor begins to be driven."""
        self._last = None
        self._gaps = 0  # between samples, too long, in a row
        self._since_s: float | None = None
        self._forget()

    def _begin(self, command: float, sample: RotorSample) -> None:
        """Begin again at a sample."""
        self._forget()
        self._since_s, self._largest = sample.time_s, abs(command)

    def _forget(self) -> None:
        self._commanded = self._measured = 0.0
        self._largest = self._largest_before = 0.0
        self._equal = 0
        self._lowest, self._highest = math.inf, -math.inf

    def add(self, command: float, sample: RotorSample) -> str:
        """Take the speed that was sent [rad/s] and the sample after it; what is wrong, or an empty text."""
        last, self._last = self._last, sample
        acted, self._before = (
            self._before,
            command,
        )  # a sample is of the moment in which its command arrives
        self._largest = max(self._largest, abs(command))
        if last is None:
            self._begin(command, sample)
            return ""
        dt = sample.time_s - last.time_s
        if dt > LONGEST_GAP_S:
            self._gaps += 1
            wrong = self._runaway(sample) or self._unwatched(dt)
            self._begin(command, sample)
            return wrong
        self._gaps = 0
        self._commanded += abs(command) * dt
        self._measured += abs(sample.angle - last.angle)
        return self._stuck(acted, sample, last) or self._runaway(sample) or self._jam(sample)

    def _stuck(self, command: float, sample: RotorSample, last: RotorSample) -> str:
        if sample.velocity != last.velocity:
            self._equal, self._lowest, self._highest = 0, math.inf, -math.inf
            return ""
        self._equal += 1
        self._lowest, self._highest = min(self._lowest, command), max(self._highest, command)
        if self._equal >= STUCK_SAMPLES and self._highest - self._lowest > STUCK_CHANGE:
            return f"rotor jammed or encoder stuck: measured speed stands still at {sample.velocity:.1f} rad/s"
        return ""

    def _unwatched(self, dt: float) -> str:
        if self._gaps < MOST_GAPS:
            return ""
        return f"nobody can see a jam: measured speed comes every {dt:.3f} s, expected {LONGEST_GAP_S:g} s or less"

    def _runaway(self, sample: RotorSample) -> str:
        limit = max(self._largest, self._largest_before) + RUNAWAY
        if abs(sample.velocity) > limit:
            return f"rotor runs away: {sample.velocity:.0f} rad/s measured, {limit - RUNAWAY:.0f} commanded at most"
        return ""

    def _jam(self, sample: RotorSample) -> str:
        since_s = sample.time_s if self._since_s is None else self._since_s
        if sample.time_s - since_s < WINDOW_S or self._commanded < WAY:
            return ""
        commanded, measured = self._commanded, self._measured
        self._since_s, self._commanded, self._measured = sample.time_s, 0.0, 0.0
        self._largest_before, self._largest = self._largest, 0.0
        if measured < LEAST_SHARE * commanded:
            return f"rotor jammed or encoder stuck: it turned {measured:.1f} of {commanded:.1f} rad"
        return ""


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
