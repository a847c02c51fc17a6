# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A folder that looks like /sys/class/pwm/pwmchipN with one exported channel."""

from pathlib import Path

INITIAL = {"period": "0\n", "duty_cycle": "0\n", "enable": "0\n", "polarity": "normal\n"}


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
