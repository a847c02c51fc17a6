# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From colours in an image to spots in the pool: the markers' colour ranges as the light shifts them, within limits, and blobs of
a marker's colour and size.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import log, pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import Calibration
from fish_vision.config import TrackerConfig
from fish_vision.pose import Spot
from fish_vision.segmentation import HUES, Blob, ColourRange, Image, find_blobs, fit_disc

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

CANDIDATES = 16  # blobs of a colour that are considered, those of a whole marker's size first
PARTLY = 0.96  # share of its area below which a marker counts as partly hidden
# pixels by which the edge of what hides a marker moves its middle, for a marker that is hidden wholly: the camera smears
# colours over the edge. The pose's covariance counts it; the test of the markers' distance stays as narrow as without.
HIDDEN_STD = 0.65
COARSE_STD = 0.15  # standard deviation of a middle in a thinned image, pixels of that image


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


Array = NDArray[Any]  # float64


class SpotFinder:
    """Finds the spots of the markers `front`, `rear`, `tail_odd` and `tail_even`."""

    def __init__(self, config: TrackerConfig, calibration: Calibration) -> None:
        self._config, self._calibration = config, calibration
        self.colours = Colours(config)
        _, scale = calibration.place_and_scale(calibration.pool_to_pixel([[0.0, 0.0]]))
        self._pixel = float(
            abs(np.linalg.det(scale[0]))
        )  # m^2 of water that a pixel shows in the middle

    def find(
        self, hsv: Image, markers: Sequence[str], origin: tuple[int, int], step: int = 1
    ) -> list[list[Spot]]:
        """Spots of each marker in a part of an image: first pixel at origin, every step-th pixel."""
        config, pixel = self._config, self._pixel * step**2
        found: list[tuple[int, Blob]] = []
        for number, marker in enumerate(markers):
            disc = pi / 4 * self._diameter(marker) ** 2
            most = self._area_max(marker)
            limits = (0.5 * config.area_min * disc / pixel, 2.0 * most * disc / pixel)
            blobs = find_blobs(hsv, self.colours.range(marker), limits)
            found += [(number, _enlarged(blob, origin, step)) for blob in blobs]
        result: list[list[Spot]] = [[] for _ in markers]
        if found:
            diameters = np.array([self._diameter(markers[number]) for number, _ in found])
            largest = np.array([self._area_max(markers[number]) for number, _ in found])
            spots = self._of_size([blob for _, blob in found], diameters, largest, step)
            for (number, _), spot in zip(found, spots, strict=True):
                if spot is not None:
                    result[number].append(spot)
        return [sorted(s, key=lambda spot: abs(log(spot.share)))[:CANDIDATES] for s in result]

    def learn(self, hsv: Image, origin: tuple[int, int], marker: str, place: Array) -> None:
        """Take the colour in the middle of a marker at a place (2,), m, as that of its kind in today's light."""
        u, v = self._calibration.pool_to_pixel([place])[0] - np.array(origin)
        column, row = round(float(u)), round(float(v))
        part = hsv[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].reshape(-1, 3)
        if len(part):
            hue, _, value = part[len(part) // 2]
            self.colours.learn(marker, float(hue), float(value))

    def _diameter(self, marker: str) -> float:
        config = self._config
        return config.tail_marker_diameter if marker.startswith("tail") else config.marker_diameter

    def _area_max(self, marker: str) -> float:
        return self._config.tail_area_max if marker.startswith("tail") else self._config.area_max

    def _of_size(
        self, blobs: Sequence[Blob], diameters: Array, largest: Array, step: int
    ) -> list[Spot | None]:
        """Blobs as spots; None for those whose area does not fit a disc of their diameter (m) at their place.

        largest: greatest area of each, share of its disc's.

            std = pixel_std / sqrt(share) + diameter (1 - share) / 3,  share = area / disc area, at most 1

        in pixels; the second term is how far a partly hidden disc's middle moves (half hidden: 0.21). Where enough
        of a partly hidden head marker's rim is seen, the rim gives its middle instead (fit_disc).
        """
        places, J = self._calibration.place_and_scale([[b.u, b.v] for b in blobs])
        areas = np.array([b.area for b in blobs])
        pixels = np.abs(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])  # m^2 of one
        shares = areas * pixels / (pi / 4 * diameters**2)
        whole = np.minimum(shares, 1.0)
        own = self._config.pixel_std if step == 1 else COARSE_STD * step
        std = own / np.sqrt(whole) + np.sqrt(4 / pi * areas) * (1.0 - whole) / 3
        result: list[Spot | None] = []
        for i, blob in enumerate(blobs):
            if not self._config.area_min <= shares[i] <= largest[i]:
                result.append(None)
                continue
            place, deviation, moved = places[i], float(std[i]), 0.0
            if step == 1 and shares[i] < PARTLY and diameters[i] == self._config.marker_diameter:
                radius = diameters[i] / 2 / np.sqrt(pixels[i])
                place, deviation = self._partly_hidden(blob, place, J[i], deviation, radius)
                moved = HIDDEN_STD * (1.0 - float(shares[i])) * float(np.sqrt(pixels[i]))
            result.append(Spot(place, deviation**2 * J[i] @ J[i].T, float(shares[i]), moved))
        return result

    def _partly_hidden(
        self, blob: Blob, place: Array, J: Array, std: float, radius: float
    ) -> tuple[Array, float]:
        """Place, m, and deviation, pixels, of a marker of which a part is hidden."""
        fit = None if blob.weight is None else fit_disc(blob.weight, radius)
        if fit is None:
            return place, std
        shift = np.array([fit[0] + blob.corner[0] - blob.u, fit[1] + blob.corner[1] - blob.v])
        if np.hypot(*shift) > radius:
            return place, std
        return place + J @ shift, max(fit[2], self._config.pixel_std)


def _enlarged(blob: Blob, origin: tuple[int, int], step: int) -> Blob:
    """A blob in pixels of the whole image; column i of a thinned image is column i step of the whole one."""
    corner = (blob.corner[0] + origin[0], blob.corner[1] + origin[1])
    u, v = blob.u * step + origin[0], blob.v * step + origin[1]
    return Blob(u, v, blob.area * step**2, corner, blob.weight if step == 1 else None)
