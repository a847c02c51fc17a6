# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A coasting rotor: where a command is forgotten, the encoder's speed replaces it.

A controller that has ended leaves its last command standing while the motor is off and the rotor runs down. The model is
driven by the measured speed there, and the encoder's distance from the forgotten command is no residual. A servo has no
feedback: it keeps the last command that it was given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT

Array = NDArray[np.float64]

STANDING = 0.5  # s; a command unchanged for longer may be a forgotten one
APART = 5.0  # rad/s, median distance of the encoder that says it was


def driven(command: Array, encoder: Array) -> tuple[Array, Array]:
    """(rotor speed (T,) that drives the model, encoder (T,) less what was used for it), both [rad/s] on the grid of 10 ms.

    encoder: NaN at grid points without a sample.
    """
    speed, left = command.copy(), encoder.copy()
    for first, last in standing(command):
        inside = np.flatnonzero(np.isfinite(encoder[first:last])) + first
        if len(inside) < 2 or np.median(np.abs(encoder[inside] - command[inside])) < APART:
            continue
        speed[first:last] = np.interp(np.arange(first, last), inside, encoder[inside])
        left[first:last] = np.nan
    return speed, left


def held_rudder(rotor: Array, rudder: Array) -> Array:
    """Rudder (T,) [rad] that a servo has which keeps its last command when the controller has ended.

    rotor (T,) [rad/s], rudder (T,) [rad]: commands. Where the rotor's command stands until the end of the trial the controller
    has ended; a rudder that is exactly 0 throughout that time was told nothing, and a servo told nothing stays where it is.
    """
    out = rudder.copy()
    stretches = [(a, b) for a, b in standing(rotor) if b == len(rotor) and a > 0]
    for first, _ in stretches:
        told = np.flatnonzero(rudder[: first + 1])
        if len(told) and not rudder[first:].any() and (first - told[-1]) * DT < STANDING:
            out[told[-1] + 1 :] = rudder[told[-1]]
    return out


def standing(command: Array) -> list[tuple[int, int]]:
    """(first, last) grid points, last excluded, of stretches in which a speed other than 0 stays the same."""
    edges = np.flatnonzero(np.diff(command, prepend=np.nan, append=np.nan) != 0)
    pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    return [(a, b) for a, b in pairs if (b - a) * DT > STANDING and command[a] != 0.0]
