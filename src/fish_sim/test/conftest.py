"""Swimming programs that several tests share."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import numpy as np
import pytest

NEAR_WALL = (0.3, 0.85, 0.1)  # m, m, rad


@pytest.fixture
def strokes():
    """strokes(periods): rotor at 2 Hz and 9 rad, rudder in steps large enough for every servo effect."""

    def program(periods: int) -> np.ndarray:
        time = 0.01 * np.arange(1, periods + 1)
        rotor = 9.0 * 4 * np.pi * np.sin(4 * np.pi * time)
        rudder = 0.5 * np.sign(np.sin(2 * np.pi * time / 0.37))
        return np.stack([rotor, rudder], axis=-1)

    return program
