# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rudder as a whole: PWM output, servo, and finding the output again after it was lost.

One thread calls step() and owns the output; commands may come from another thread.
"""

import threading
import time
from collections.abc import Callable
from typing import Protocol

from fish_hw.devices.reconnect import Link
from fish_hw.devices.rudder_servo import RudderServo
from fish_hw.devices.status import ERROR, OK, WARN, Status
from fish_hw.settings.rudder import RudderSettings
from fish_hw.transport.errors import TransportError

CHECK_S = 1.0  # how often the output is asked whether it still works
SETTLE_S = 0.1  # beyond the time that the slew limit gives


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
    """Follows commands while the robot is armed; centres when it is not, when they stop, at the start and at the end."""

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
        """Why the rudder cannot steer; empty while its output works."""
        return "" if self._output is not None else self._link.trouble or "output lost"

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
                "the PWM output stopped by itself (supply lost, or another program switched it off)"
            )
        return self._link.works()

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
