# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the head swings with the stroke: cosine and sine of its heading at the rotor's frequency, linear in the poses.

Stroke means average the swing out. A model may then swing twice as far as the fish, and get its thrust from that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.prediction.stroke_average import HALF_WINDOW

Array = NDArray[np.float64]

STILL = 3.0  # rad/s, standard deviation of a rotor that makes no stroke
FEWEST = 7  # frames in a window; four numbers are fitted to them
FASTEST = (
    0.8 * np.pi
)  # rad of stroke between two frames; beyond it the swing cannot be told from a slower one


def stroke_frequency(rotor: Array) -> float:
    """Circular frequency [rad/s] of a rotor's speed (N,) on the grid; 0 of one that stands still or turns steadily.

    The ratio of the root mean squares of rate and value: exact for whole strokes, within a tenth for one and a half.
    """
    swing = rotor - rotor.mean()
    size = float(np.std(swing))
    return float(np.std(np.diff(swing))) / DT / size if size > STILL else 0.0


def swing_weights(t: Array, frequency: float) -> Array:
    """(2, F) weights of headings at t (F,) [s] from the window's centre: amplitudes of cosine and sine [rad].

    Least squares of a straight line and both, with the window of the stroke mean. Zeros where there is no stroke or where the
    frames do not show it.
    """
    if len(t) < FEWEST or not 0.0 < frequency * float(np.median(np.diff(t))) < FASTEST:
        return np.zeros((2, len(t)))
    window = np.cos(0.5 * np.pi * t / HALF_WINDOW)
    columns = np.column_stack([np.ones_like(t), t, np.cos(frequency * t), np.sin(frequency * t)])
    found: Array = (np.linalg.pinv(columns * window[:, None]) * window)[2:]
    return found
