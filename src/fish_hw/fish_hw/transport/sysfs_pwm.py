# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One PWM channel of the kernel through /sys/class/pwm, no dependency."""

import errno
import time
from collections.abc import Callable
from glob import glob
from pathlib import Path

from fish_hw.transport.interfaces import TransportError, unavailable

EXPORT_WAIT_S = 0.5  # udev needs some tenths of a second to hand the new files to the group
RETRY_S = 0.01
NORMAL = "normal"  # polarity: the pulse is high, the rest of the period low
HINT = "enable it: dtoverlay=pwm-2chan"
REASONS = {
    errno.EACCES: "no permission (add the user to group gpio and install 99-fish.rules of fish_hw)",
    errno.ENOENT: "its files period, duty_cycle and enable did not appear",
    errno.ENODEV: "the chip has no such channel",
    errno.EBUSY: "another program holds it",
}


class SysfsPwm:
    """A PWM channel: period once, then pulse lengths in nanoseconds.

    Args:
        chip: folder of the PWM chip, /sys/class/pwm/pwmchip0.
        channel: channel number on that chip.
        period_ns: repetition time.

    Raises:
        PortUnavailable: chip absent, channel refused or files not writable.
    """

    def __init__(
        self, chip: str, channel: int, period_ns: int, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._chip = Path(chip)
        self._pwm = self._chip / f"pwm{channel}"
        self._channel = channel
        self._period_ns = period_ns
        self._sleep = sleep
        if not self._chip.is_dir():
            others = sorted(glob(str(self._chip.parent / "pwmchip*")))
            raise unavailable(f"PWM chip {chip}", f"there is no such chip ({HINT})", others)
        try:
            self._export()
            self._wait_until_writable()
        except OSError as error:
            reason = REASONS.get(error.errno or 0, str(error))
            raise unavailable(f"PWM channel {self._pwm}", reason, self._exported()) from error

    def start(self, pulse_ns: int) -> None:
        """Set period, polarity and pulse, then switch the pulses on.

        The kernel refuses a period shorter than the present duty cycle, so a longer one is cleared first; but not
        always, since kernels before mid-2024 refuse every duty cycle while the period is 0, as after a boot.
        It changes the polarity of a channel that is off and has a period. A channel that was left inversed is high for the
        rest of the period: 18.5 ms instead of 1.5 ms at 50 Hz.
        """
        inversed = self._text("polarity") != NORMAL
        if inversed and self._read("enable"):
            self._write("enable", 0)
        if self._read("duty_cycle") > self._period_ns:
            self._write("duty_cycle", 0)
        self._write("period", self._period_ns)
        if inversed:
            self._write("polarity", NORMAL)
        self._write("duty_cycle", pulse_ns)
        self._write("enable", 1)

    def set_pulse_ns(self, pulse_ns: int) -> None:
        """Change the length of the pulses."""
        self._write("duty_cycle", pulse_ns)

    def stop(self) -> None:
        """Switch the pulses off."""
        self._write("enable", 0)

    def is_running(self) -> bool:
        """Whether pulses are on with our period, as the kernel says."""
        return self._read("enable") == 1 and self._read("period") == self._period_ns

    def close(self) -> None:
        """Nothing to give back: the channel stays exported and keeps its pulses."""

    def _export(self) -> None:
        if self._pwm.is_dir():
            return
        try:
            (self._chip / "export").write_text(f"{self._channel}\n")
        except OSError as error:
            if error.errno != errno.EBUSY:  # EBUSY: somebody exported it between the two lines
                raise

    def _wait_until_writable(self) -> None:
        """Wait for udev: right after the export the files belong to root only."""
        for _ in range(round(EXPORT_WAIT_S / RETRY_S)):
            try:
                return self._require_writable()
            except OSError:
                self._sleep(RETRY_S)
        self._require_writable()

    def _require_writable(self) -> None:
        for name in ("period", "duty_cycle", "enable"):
            with open(self._pwm / name, "r+"):
                pass

    def _exported(self) -> list[str]:
        return sorted(path.name for path in self._chip.glob("pwm[0-9]*"))

    def _text(self, name: str) -> str:
        try:
            return (self._pwm / name).read_text().strip()
        except (OSError, ValueError) as error:
            raise TransportError(f"PWM {self._pwm}: cannot read {name}: {error}") from error

    def _read(self, name: str) -> int:
        text = self._text(name)
        try:
            return int(text)
        except ValueError as error:
            raise TransportError(f"PWM {self._pwm}: cannot read {name}: {error}") from error

    def _write(self, name: str, value: int | str) -> None:
        try:
            (self._pwm / name).write_text(f"{value}\n")
        except OSError as error:
            raise TransportError(
                f"PWM {self._pwm}: cannot write {value} to {name}: {error}"
            ) from error
