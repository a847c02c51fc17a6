# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the rotor does what it is commanded: jam, stuck encoder, runaway.

Compared over windows: commanded way L_c = integral of |omega_c|, measured way L_m = sum of |delta theta|.
"""

import math

from fish_hw.devices.vertiq import RotorSample

WINDOW_S = 0.1  # shortest window; the module's velocity loop settles in some 0.02 s
WAY = 2.0  # rad, shortest commanded way that is judged
LEAST_SHARE = 0.3  # of the commanded way; a rotor with less is held
STUCK_SAMPLES = 10  # equal speeds in a row while the command changes
STUCK_CHANGE = 10.0  # rad/s, change of the command meanwhile
LONGEST_GAP_S = 0.05  # between samples; over a longer one neither way is known
RUNAWAY = 60.0  # rad/s beyond every command of the last two windows


class MotionCheck:
    """Judges samples against the commands that were sent for them."""

    def __init__(self) -> None:
        self._last: RotorSample | None = None
        self._before = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin again, when the rotor begins to be driven."""
        self._last = None
        self._since_s: float | None = None
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
            self._since_s = sample.time_s
            return ""
        dt = sample.time_s - last.time_s
        if dt > LONGEST_GAP_S:
            self.restart()
            return ""
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
