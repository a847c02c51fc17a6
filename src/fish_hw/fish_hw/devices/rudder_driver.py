# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rudder as a whole: PWM output, servo, and finding the output again after it was lost.

One thread calls step() and owns the output; commands may come from another thread.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fish_hw.devices.reconnect import ERROR, OK, WARN, Link, Status
from fish_hw.settings import RudderSettings
from fish_hw.transport.interfaces import TransportError

LONGEST_STEP_S = 0.05  # a cycle that was late must not earn a larger jump

CHECK_S = 0.1  # how often the output is asked whether it still works
STAYS_S = 1.0  # since it was opened, until it counts as one that works
SETTLE_S = 0.1  # beyond the time that the slew limit gives


@dataclass
class RudderCounters:
    """Commands that were not followed as given."""

    rejected: int = 0
    clamped: int = 0


class RudderServo:
    """Turns commands into pulses; times in s of one monotonic clock.

    Attributes:
        stop: why the rudder ceased to follow commands although nobody disarmed it; it stays at the centre until somebody does.
            Empty otherwise.
    """

    def __init__(self, settings: RudderSettings) -> None:
        self.counters = RudderCounters()
        self.alpha = 0.0  # rad, sent last
        self.stop = ""
        self._settings = settings
        self._target = 0.0
        self._target_time: float | None = None
        self._armed_time: float | None = None
        self._last_step: float | None = None
        self._following = False

    def command(self, alpha: float, now: float) -> None:
        """Take a commanded angle [rad]; what is no number, or more than half a turn, is rejected and counted."""
        if not abs(alpha) <= math.pi:
            self.counters.rejected += 1
            return
        limit = self._settings.max_angle
        self.counters.clamped += abs(alpha) > limit
        self._target = min(max(alpha, -limit), limit)
        self._target_time = now

    def armed(self, armed: bool, now: float) -> None:
        """Take the word of the arming state's owner."""
        self._armed_time = now if armed else None
        if not armed:
            self.stop, self._following = "", False

    def idle(self, now: float) -> str:
        """Why the rudder does not follow commands; empty if it does."""
        if self._armed_time is None:
            return "disarmed"
        if self.stop:
            return self.stop
        if now - self._armed_time > self._settings.armed_timeout_s:
            return f"no arming/state for {self._settings.armed_timeout_s:g} s"
        if self._target_time is None or now - self._target_time > self._settings.stale_s:
            return f"no command for {self._settings.stale_s:g} s"
        return ""

    def step(self, now: float) -> int:
        """Pulse [ns] of this cycle: towards the command, or to the centre while it is idle."""
        since = 0.0 if self._last_step is None else now - self._last_step
        dt = min(max(since, 0.0), LONGEST_STEP_S)
        self._last_step = now
        idle = self.idle(now)
        if idle and self._following:
            self.stop = idle
        self._following = not idle
        target = 0.0 if idle else self._target
        most = self._settings.max_rate * dt
        self.alpha += min(max(target - self.alpha, -most), most)
        return self.pulse_ns(self.alpha)

    def centre_ns(self) -> int:
        """Pulse [ns] of alpha = 0; forgets the last angle."""
        self.alpha = 0.0
        return self.pulse_ns(0.0)

    def pulse_ns(self, alpha: float) -> int:
        """Pulse [ns] for a rudder angle [rad], within the mechanical stops."""
        settings = self._settings
        us = settings.centre_us + settings.us_per_rad * settings.sign * (alpha + settings.trim)
        return round(1000 * min(max(us, settings.min_us), settings.max_us))


class PwmOutput(Protocol):
    """What a servo hangs on: sysfs PWM or PCA9685."""

    def start(self, pulse_ns: int) -> None:
        """Set the rate and begin with this pulse."""
        ...

    def set_pulse_ns(self, pulse_ns: int) -> None:
        """Change the pulse."""
        ...

    def stop(self) -> None:
        """Pulses off."""
        ...

    def is_running(self) -> bool:
        """Whether pulses are on at the right rate."""
        ...

    def close(self) -> None:
        """Give the port back; pulses go on as they are."""
        ...


class RudderDriver:
    """Follows commands while the robot is armed; centres when it is not, when they stop, at the start and at the end.

    A silence of the commands or of the arming state is a trouble: the owner of the arming state disarms the robot.
    """

    def __init__(
        self,
        settings: RudderSettings,
        open_output: Callable[[], PwmOutput],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.servo = RudderServo(settings)
        self._settings = settings
        self._open_output = open_output
        self._clock = clock
        self._sleep = sleep
        self._lock = threading.Lock()  # of the servo: commands arrive on another thread
        self._output: PwmOutput | None = None
        self._link = Link("rudder output")
        self._pulse_ns = 0
        self._connected_s = 0.0
        self._checked = 0.0
        self._idle = "disarmed"

    @property
    def connected(self) -> bool:
        """Whether the device is open."""
        return self._output is not None

    def connect(self) -> None:
        """Open the output where the servo is; PortUnavailable or TransportError if it cannot.

        That is the centre at the start, and after a loss the angle that was sent last: from there the slew limit holds.
        """
        output = self._open_output()
        self._pulse_ns = self.servo.pulse_ns(self.servo.alpha)
        self._checked = self._connected_s = self._clock()
        self._output = (
            output  # before there are pulses: close() ends them, too, if a signal interrupts this
        )
        try:
            output.start(self._pulse_ns)
        except TransportError:
            output.close()
            self._output = None
            raise

    def command(self, alpha: float) -> None:
        """Take a commanded angle [rad]."""
        with self._lock:
            self.servo.command(alpha, self._clock())

    def armed(self, armed: bool) -> None:
        """Take the word of the arming state's owner."""
        with self._lock:
            self.servo.armed(armed, self._clock())

    @property
    def trouble(self) -> str:
        """Why the rudder cannot steer; empty while its output works and it has not stopped by itself."""
        return self.servo.stop if self._output is not None else self._link.trouble or "output lost"

    def step(self) -> list[str]:
        """One cycle; returns events worth a line in the log."""
        now = self._clock()
        try:
            if self._output is None:
                return self._reconnect(now)
            return self._cycle(self._output, now)
        except TransportError as error:
            if self._output is not None:
                self._output.close()
            self._output = None
            return self._link.lose(str(error), now)

    def close(self) -> None:
        """Make safe and give the output back, as well as that can be done."""
        try:
            self.make_safe()
        except TransportError as error:
            self._link.trouble = f"rudder not centred: {error}"

    def make_safe(self) -> None:
        """Centre, then pulses off if the settings say so, but not before the servo has had time to get there.

        The output is given back in any case. TransportError if it could not be told.
        """
        if self._output is None:
            return
        travel_s = self._travel_s() + SETTLE_S
        try:
            self._output.set_pulse_ns(self.servo.centre_ns())
            if self._settings.off_at_exit:
                self._sleep(travel_s)
                self._output.stop()
        finally:
            self._output.close()
            self._output = None

    def status(self) -> Status:
        """State in one line with counters."""
        values: dict[str, object] = {
            "alpha sent [rad]": round(self.servo.alpha, 4),
            "pulse [us]": self._pulse_ns / 1000,
            "rejected commands": self.servo.counters.rejected,
            "clamped commands": self.servo.counters.clamped,
            "reconnect attempts": self._link.attempts,
        }
        if self._output is None:
            return Status(ERROR, self._link.trouble, values)
        if self._idle:
            return Status(WARN, f"centred: {self._idle}", values)
        return Status(OK, "following commands", values)

    def _cycle(self, output: PwmOutput, now: float) -> list[str]:
        with self._lock:
            pulse_ns = self.servo.step(now)
            idle = self.servo.idle(now)
        if pulse_ns != self._pulse_ns:
            output.set_pulse_ns(pulse_ns)
            self._pulse_ns = pulse_ns
        events = self._check(output, now) if now - self._checked >= CHECK_S else []
        if idle != self._idle:
            self._idle = idle
            events.append(f"rudder centred: {idle}" if idle else "rudder follows commands")
        return events

    def _check(self, output: PwmOutput, now: float) -> list[str]:
        self._checked = now
        if not output.is_running():
            raise TransportError(
                "the PWM output stopped by itself or has another period (supply lost, or another program uses it)"
            )
        return self._link.works() if now - self._connected_s >= STAYS_S else []

    def _travel_s(self) -> float:
        """How long the servo needs to the centre at the most: from the angle that was sent, and right after
        connect(), which knows nothing of the angle before, from stop to stop.
        """
        settings = self._settings
        unknown_s = 2 * settings.max_angle / settings.max_rate - (self._clock() - self._connected_s)
        return max(abs(self.servo.alpha) / settings.max_rate, unknown_s)

    def _reconnect(self, now: float) -> list[str]:
        if self._link.due(now):
            self.connect()
        return []
