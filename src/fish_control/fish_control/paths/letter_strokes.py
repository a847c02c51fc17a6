# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The strokes of the letters, as corners to be rounded; units of letter height.

A corner is (x, y) or (x, y, radius). Turns that a pen would make by lifting are loops, because a fish can
neither stop nor turn on the spot. No radius is below 0.165 heights (0.28 m for a letter of 1.7 m), or 0.18 where
the letter must be lower: the nominal fish turns in 0.26 m with its rudder hard over.
"""

from __future__ import annotations

from dataclasses import dataclass

TIGHTEST = 0.165  # letter heights


@dataclass(frozen=True)
class Stroke:
    """Corners of one letter in the order swum; `radius` rounds corners that give none."""

    corners: tuple[tuple[float, ...], ...]
    radius: float = TIGHTEST
    closed: bool = False


STROKES: dict[str, Stroke] = {
    "A": Stroke(((0, 0), (0.42, 1), (0.84, 0), (1.2, 0), (1.2, 0.4), (0.05, 0.4))),
    "B": Stroke(
        (
            (0, 0),
            (0, 1),
            (0.6, 1),
            (0.6, 0.666),
            (0.2, 0.666),
            (0.2, 0.334),
            (0.7, 0.334),
            (0.7, 0),
            (0, 0),
        )
    ),
    "C": Stroke(((0.65, 1), (0, 1), (0, 0), (0.65, 0)), 0.33),
    "D": Stroke(((0, 0), (0, 1, 0.2), (0.7, 1), (0.7, 0), (0.05, 0)), 0.35),
    "E": Stroke(
        ((0.65, 1), (0, 1), (0, 0.666), (0.45, 0.666), (0.45, 0.334), (0, 0.334), (0, 0), (0.65, 0))
    ),
    "F": Stroke(((0.65, 1), (0, 1), (0, 0), (-0.34, 0), (-0.34, 0.5), (0.5, 0.5))),
    "G": Stroke(((0.65, 1), (0, 1), (0, 0), (0.65, 0), (0.65, 0.5), (0.3, 0.5)), 0.25),
    "H": Stroke(
        ((0, 1), (0, 0), (-0.36, 0), (-0.36, 0.5), (1.01, 0.5), (1.01, 1), (0.65, 1), (0.65, 0)),
        0.18,
    ),
    "I": Stroke(((0, 0), (0, 1))),
    "J": Stroke(((0.5, 1), (0.5, 0), (0, 0), (0, 0.35)), 0.25),
    "K": Stroke(((0, 0), (0, 1), (0.62, 1), (0.05, 0.5), (0.65, 0)), 0.18),
    "L": Stroke(((0, 1), (0, 0), (0.65, 0)), 0.2),
    "M": Stroke(((0, 0), (0.25, 1), (0.75, 0.1), (1.25, 1), (1.5, 0))),
    "N": Stroke(((0, 0), (0, 1), (0.9, 0), (0.9, 1)), 0.18),
    "O": Stroke(((0, 0.62), (0, 0), (0.72, 0), (0.72, 1), (0, 1)), 0.36, closed=True),
    "P": Stroke(((0, 0), (0, 1, 0.2), (0.6, 1), (0.6, 0.48), (0.05, 0.48)), 0.26),
    "Q": Stroke(
        (
            (0.75, 0.35),
            (0.75, 1),
            (0, 1),
            (0, 0),
            (0.75, 0),
            (0.75, 0.62, 0.185),
            (0.38, 0.62, 0.185),
            (0.38, 0.3),
            (0.95, -0.1),
        ),
        0.25,
    ),
    "R": Stroke(((0, 0), (0, 1), (0.66, 1), (0.66, 0.57), (-0.251, 0.57), (0.428, 0)), 0.215),
    "S": Stroke(((0.62, 1), (0, 1), (0, 0.5), (0.62, 0.5), (0.62, 0), (0, 0)), 0.25),
    "T": Stroke(((0, 0.63), (0.81, 0.63), (0.81, 1), (0.45, 1), (0.45, 0)), 0.18),
    "U": Stroke(((0, 1), (0, 0), (0.65, 0), (0.65, 1)), 0.32),
    "V": Stroke(((0, 1), (0.45, 0), (0.9, 1))),
    "W": Stroke(((0, 1), (0.25, 0), (0.75, 0.9), (1.25, 0), (1.5, 1))),
    "X": Stroke(((0, 1), (0.7, 0), (1.1, 0), (1.1, 1), (0.7, 1), (0, 0)), 0.185),
    "Y": Stroke(((0, 0.95), (0.38, 0.4), (0.94, 0.62), (0.94, 1), (0.58, 1), (0.1, 0)), 0.18),
    "Z": Stroke(((0, 1), (0.75, 1), (0, 0), (0.75, 0))),
}
