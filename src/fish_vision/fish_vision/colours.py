# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The markers' colour ranges as the light shifts them, within limits."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from fish_vision.config import TrackerConfig
from fish_vision.segmentation import HUES, ColourRange

MARKERS = ("front", "rear", "tail_odd", "tail_even")
SHARE = 0.05  # of the way to what is seen, per picture that teaches
FIRST_SHARE = 0.3  # at most, of the first pictures
SMALL_SHIFT = 2  # half degrees, which a range bears
DARKER = 0.5  # share of a marker's value at which its range begins: a hull that the light tints is much darker
VALUE_LEAST = 40.0  # no range begins below
CASTS = (  # gains of red and blue of a light that the ranges were not made for, the nearest first
    (1.15, 0.85),
    (0.85, 1.15),
    (1.25, 0.70),
    (0.75, 1.25),
    (1.35, 0.55),
    (0.65, 1.35),
    (1.50, 0.45),
)


class Colours:
    """Ranges of the parameters, each moved in hue by at most `hue_shift_max`, and begun at half the value of its marker.

    cast: gains of red and blue of the light, from which the hues start.
    """

    def __init__(self, config: TrackerConfig, cast: tuple[float, float] = (1.0, 1.0)) -> None:
        self._most = float(config.hue_shift_max)
        self._given = {marker: config.colour(marker) for marker in MARKERS}
        self._ranges: dict[str, ColourRange] = {}  # as they are now
        self.shifts = dict.fromkeys(MARKERS, 0.0)  # half degrees
        self._value_min = {m: float(r.value_min) for m, r in self._given.items()}
        self._taught = dict.fromkeys(MARKERS, 0)  # pictures
        if cast != (1.0, 1.0):
            for marker, given in self._given.items():
                hue = middle(given)
                seen = _hue_under(hue, (given.saturation_min + 255) / 2, (cast[1], 1.0, cast[0]))
                self._move(marker, (seen - hue + HUES / 2) % HUES - HUES / 2)

    @property
    def settled(self) -> bool:
        """Whether every marker has been seen in so many pictures that a few more change little."""
        return min(self._taught.values()) * SHARE >= 1.0

    def range(self, marker: str) -> ColourRange:
        """The range in which a marker is looked for now."""
        if marker not in self._ranges:
            self._ranges[marker] = self._range(marker)
        return self._ranges[marker]

    def _range(self, marker: str) -> ColourRange:
        given, shift = self._given[marker], self._shift(marker)
        return replace(
            given,
            hue_low=(given.hue_low + shift) % HUES,
            hue_high=(given.hue_high + shift) % HUES,
            value_min=round(self._value_min[marker]),
        )

    def _shift(self, marker: str) -> int:
        """By how much the range is moved: a small shift stays within it, and would move the blobs' edges."""
        shift = round(self.shifts[marker])
        return shift if abs(shift) > SMALL_SHIFT else 0

    def learn(self, marker: str, hue: float, value: float) -> None:
        """Move a range towards the hue (half degrees) and value that its marker shows, at first as a mean of what was seen."""
        shift = (hue - middle(self._given[marker]) + HUES / 2) % HUES - HUES / 2
        if abs(shift) > self._most + 10.0:  # glare or something else lies over the marker
            return
        self._taught[marker] += 1
        share = min(max(1.0 / self._taught[marker], SHARE), FIRST_SHARE)
        self._move(marker, self.shifts[marker] + share * (shift - self.shifts[marker]))
        least = max(DARKER * value, VALUE_LEAST)
        self._value_min[marker] += share * (least - self._value_min[marker])

    def _move(self, marker: str, shift: float) -> None:
        self._ranges.pop(marker, None)
        self.shifts[marker] = float(np.clip(shift, -self._most, self._most))


def middle(colour: ColourRange) -> float:
    """Middle hue of a range, half degrees."""
    return (colour.hue_low + ((colour.hue_high - colour.hue_low) % HUES) / 2) % HUES


def _hue_under(hue: float, saturation: float, gains: Sequence[float]) -> float:
    """Hue of a colour after its blue, green and red are multiplied with gains."""
    pixel = np.array([[[round(hue) % HUES, round(saturation), 200]]], np.uint8)
    light = cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR).astype(float) * np.array(gains)
    light *= 255.0 / max(float(light.max()), 255.0)
    return float(cv2.cvtColor(light.astype(np.uint8), cv2.COLOR_BGR2HSV)[0, 0, 0])
