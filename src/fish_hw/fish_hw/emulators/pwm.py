# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rudder's two PWM outputs made of software: a chip of the kernel as files, and a PCA9685 at the level of its I2C
registers.
"""

from pathlib import Path

INITIAL = {"period": "0\n", "duty_cycle": "0\n", "enable": "0\n", "polarity": "normal\n"}

SLEEP = 0x10
PRESCALE = 0xFE


class PwmChipEmulator:
    """Makes the files of a chip below `folder`; reads back what a driver wrote."""

    def __init__(self, folder: Path, channel: int = 0) -> None:
        self.chip = folder
        self.channel = folder / f"pwm{channel}"
        self.channel.mkdir(parents=True)
        (folder / "export").write_text("")
        (folder / "npwm").write_text("2\n")
        for name, text in INITIAL.items():
            (self.channel / name).write_text(text)

    def read(self, name: str) -> int:
        """The number that stands in a file of the channel."""
        return int((self.channel / name).read_text())


class Pca9685Emulator:
    """Register file with auto-increment; the divider is writable only asleep, as in the chip."""

    def __init__(self) -> None:
        self.registers = bytearray(256)
        self.log: list[bytes] = []
        self._pointer = 0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Back to the values after power-on."""
        self.registers[:] = bytes(256)
        self.registers[0x00] = SLEEP | 0x01
        self.registers[PRESCALE] = 0x1E

    def write(self, data: bytes) -> None:
        """Register number and values."""
        self.log.append(bytes(data))
        self._pointer = data[0]
        for offset, value in enumerate(data[1:]):
            register = data[0] + offset
            if register != PRESCALE or self.registers[0x00] & SLEEP:
                self.registers[register] = value

    def read(self, count: int) -> bytes:
        """Values from the register written last."""
        return bytes(self.registers[self._pointer : self._pointer + count])

    def pulse_counts(self, channel: int) -> tuple[int, int]:
        """(on, off) counts of an output."""
        start = 0x06 + 4 * channel
        on = int.from_bytes(self.registers[start : start + 2], "little")
        return on, int.from_bytes(self.registers[start + 2 : start + 4], "little")
