# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swimming programs that several tests share."""

import importlib.util
import os
from pathlib import Path

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import numpy as np
import pytest

TORCH = importlib.util.find_spec("torch") is not None
# the second implementation in torch is only for training and for these tests
collect_ignore = [
    path.name
    for path in Path(__file__).parent.glob("test_*.py")
    if not TORCH and any(word in path.read_text() for word in ("torch", "import lagrangian"))
]
NEAR_WALL = (0.3, 0.85, 0.1)  # m, m, rad


def pytest_report_header() -> str:
    """Say which tests are left out."""
    return f"left out without torch: {', '.join(collect_ignore)}" if collect_ignore else ""


@pytest.fixture
def strokes():
    """strokes(periods): rotor at 2 Hz and 9 rad, rudder in steps large enough for every servo effect."""

    def program(periods: int) -> np.ndarray:
        time = 0.01 * np.arange(1, periods + 1)
        rotor = 9.0 * 4 * np.pi * np.sin(4 * np.pi * time)
        rudder = 0.5 * np.sign(np.sin(2 * np.pi * time / 0.37))
        return np.stack([rotor, rudder], axis=-1)

    return program
