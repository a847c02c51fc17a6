# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the fake robot."""

from dataclasses import dataclass

from fish_hw.settings.checks import require_range


@dataclass(frozen=True)
class FakeRobotSettings:
    """Where the devices are, and what they are like."""

    folder: str = "/tmp/fake_robot"  # folder of the devices, made if it is not there
    rate_hz: float = 100.0  # Hz, of the motion that the simulator is given
    seed: int = 0  # of the noise that faults make

    def __post_init__(self) -> None:
        if not self.folder:
            raise ValueError("folder is '', expected a folder for the devices")
        require_range("rate_hz", self.rate_hz, 20.0, 200.0)
        require_range("seed", self.seed, 0, 2**31 - 1)
