# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Colour ranges of the markers proposed from pictures: the fish is found by the places of its markers, whatever their colours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import cv2
import numpy as np

from fish_vision.calibration import Calibration, CalibrationError
from fish_vision.colours import MARKERS
from fish_vision.config import TrackerConfig
from fish_vision.heads import Head, HeadFinder
from fish_vision.pose import Spot, link_ends
from fish_vision.segmentation import HUES, ColourRange, Image, hsv_of
from fish_vision.spots import CANDIDATES, SpotFinder

WATER_WIDTH = 12  # half degrees around the commonest hue that count as water
BAND, BAND_STEP = (
    36,
    12,
)  # half degrees, width of the bands in which discs are looked for, and between them
SATURATION_LEAST, VALUE_LEAST = 80, 70  # of a marker
ALIKE = 0.1  # of a marker's diameter, between places that bands agree on
MIDDLE = 0.35  # share of a marker's diameter around its middle whose pixels are measured
HUE_MARGIN = 8  # half degrees beyond the hues seen
LEVEL_SHARE = 0.6  # share of the least saturation and value seen


@dataclass(frozen=True)
class Sighting:
    """Where a picture shows the markers: pixels (u, v) and radius, in the order of MARKERS; links repeat."""

    marks: tuple[tuple[str, float, float, float], ...]  # marker, u, v, radius


def propose(
    pictures: Sequence[Image], config: TrackerConfig, calibration: Calibration
) -> tuple[dict[str, list[int]], list[Sighting | None]]:
    """Ranges of each marker's colour, and where each picture shows the fish (None: not found).

    Raises:
        CalibrationError: no picture shows the fish with its whole tail, or the config marks no tail.
    """
    if not config.tail_links:
        raise CalibrationError(
            "tail_links = 0: expected a marked tail, by which the fish is found; set the colours by hand with check_image"
        )
    sightings = [_sighting(picture, config, calibration) for picture in pictures]
    if not any(sightings):
        raise CalibrationError(
            f"none of {len(pictures)} pictures shows one fish with all its markers: check sizes and places of the markers, "
            "the lens and the mount; every marker must be in view"
        )
    return ranges(pictures, sightings), sightings


def ranges(pictures: Sequence[Image], sightings: Sequence[Sighting | None]) -> dict[str, list[int]]:
    """Marker -> [hue low, hue high, least saturation, least value] that holds its pixels in all pictures."""
    pixels: dict[str, list[Image]] = {marker: [] for marker in MARKERS}
    for picture, sighting in zip(pictures, sightings, strict=True):
        for marker, u, v, radius in sighting.marks if sighting else ():
            pixels[marker].append(_inside(picture, u, v, radius))
    return {m: _range(np.vstack(p)) for m, p in pixels.items() if p}


def clicked(
    points: Mapping[str, tuple[float, float]], config: TrackerConfig, calibration: Calibration
) -> Sighting:
    """The markers at pixels that a person clicked, name -> u, v."""
    pixels = np.array([points[name] for name in points]).reshape(-1, 2)
    return _at(list(points), pixels, config, calibration)


def tinted(picture: Image, found: Mapping[str, Sequence[int]]) -> Image:
    """Copy of a picture, grey but for the pixels in the ranges found."""
    hsv = hsv_of(picture, (0, 0, picture.shape[1], picture.shape[0]))
    masks = [ColourRange(*colour).mask(hsv) > 0 for colour in found.values()]
    grey = cv2.cvtColor(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    held = np.any(masks, axis=0)
    result: Image = grey // 2
    result[held] = picture[held]
    return result


def _sighting(picture: Image, config: TrackerConfig, calibration: Calibration) -> Sighting | None:
    """The one head with the whole tail behind it, of discs of any hue but the water's."""
    discs, links = _any_spots(picture, config, calibration)
    finder = HeadFinder(config)
    heads = [
        head
        for head in finder.heads(discs, discs, [links, links])[0]
        if len(head.tail) == config.tail_links and not head.swapped
    ]
    if not heads:
        return None
    best = min(heads, key=lambda head: abs(head.misfit))
    return _marks(best, finder, config, calibration)


def _any_spots(
    picture: Image, config: TrackerConfig, calibration: Calibration
) -> tuple[list[Spot], list[Spot]]:
    """Spots of the size of the head's and of the tail's markers, of any hue but the water's.

    They are looked for in one band of hues after another: JPEG smears colours over some pixels, and neighbouring markers
    of different hues would grow together in one range of all hues.
    """
    hsv = hsv_of(picture, (0, 0, picture.shape[1], picture.shape[0]))
    water = int(np.argmax(np.bincount(hsv[::4, ::4, 0].ravel(), minlength=HUES)))
    found: tuple[list[Spot], list[Spot]] = [], []
    for low in range(water + WATER_WIDTH, water + HUES - WATER_WIDTH - BAND + 1, BAND_STEP):
        band = (low % HUES, (low + BAND) % HUES, SATURATION_LEAST, VALUE_LEAST)
        narrow = replace(config, front_colour=band, tail_odd_colour=band, hue_shift_max=0)
        spots = SpotFinder(narrow, calibration).find(hsv, ("front", "tail_odd"), (0, 0))
        for kind, more in zip(found, spots, strict=True):
            kind += more
    return _apart(found[0], config.marker_diameter), _apart(found[1], config.tail_marker_diameter)


def _apart(spots: Sequence[Spot], diameter: float) -> list[Spot]:
    """Of spots of several bands at one place the one that most bands agree on, then that of the best size; diameter: m.

    A band that holds only a part of a marker's hues shows a part of it, elsewhere than the others.
    """
    places = np.array([spot.position for spot in spots]).reshape(-1, 2)
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    alike = np.sum(apart < ALIKE * diameter, axis=1).tolist()
    order = sorted(range(len(spots)), key=lambda i: (-alike[i], abs(log(spots[i].share))))
    kept: list[int] = []
    for i in order:
        if all(apart[i, k] > diameter / 2 for k in kept):
            kept.append(i)
    return [spots[i] for i in kept[:CANDIDATES]]


def _marks(
    head: Head, finder: HeadFinder, config: TrackerConfig, calibration: Calibration
) -> Sighting:
    places = [("front", head.front.position), ("rear", head.rear.position)]
    ends = link_ends(head.pose, head.tail, finder.layout)
    places += [("tail_even" if i % 2 else "tail_odd", end) for i, end in enumerate(ends)]
    pixels = calibration.pool_to_pixel(np.array([place for _, place in places]))
    return _at([marker for marker, _ in places], pixels, config, calibration)


def _at(
    markers: Sequence[str], pixels: np.ndarray, config: TrackerConfig, calibration: Calibration
) -> Sighting:
    """Markers at pixels (N, 2) with the radius that each has there."""
    marks = []
    scales = calibration.place_and_scale(pixels)[1]
    for marker, (u, v), scale in zip(markers, pixels, scales, strict=True):
        size = config.tail_marker_diameter if marker.startswith("tail") else config.marker_diameter
        radius = size / 2 / float(np.sqrt(abs(np.linalg.det(scale))))
        marks.append((marker, float(u), float(v), radius))
    return Sighting(tuple(marks))


def _inside(picture: Image, u: float, v: float, radius: float) -> Image:
    """(N, 3) HSV of the pixels in a marker's middle."""
    rows, columns = np.ogrid[: picture.shape[0], : picture.shape[1]]
    near = (columns - u) ** 2 + (rows - v) ** 2 <= max(2 * MIDDLE * radius, 0.8) ** 2
    return cv2.cvtColor(picture[near].reshape(-1, 1, 3), cv2.COLOR_BGR2HSV).reshape(-1, 3)


def _range(hsv: Image) -> list[int]:
    """[hue low, hue high, least saturation, least value] that holds pixels (N, 3) with a margin."""
    angle = hsv[:, 0] * (2 * np.pi / HUES)
    middle = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean()) * HUES / (2 * np.pi)
    off = (hsv[:, 0] - middle + HUES / 2) % HUES - HUES / 2
    low, high = np.percentile(off, [5, 95]) + middle + np.array([-HUE_MARGIN, HUE_MARGIN])
    levels = LEVEL_SHARE * np.percentile(hsv[:, 1:], 5, axis=0)
    return [round(low) % HUES, round(high) % HUES, *np.round(levels).astype(int).tolist()]


def drawn(picture: Image, sighting: Sighting | None) -> Image:
    """Copy of a picture with rings and names at the markers, or the word that none was found."""
    result = picture.copy()
    if sighting is None:
        cv2.putText(
            result, "no fish found", (12, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 0, 255), 2
        )
    for marker, u, v, radius in sighting.marks if sighting else ():
        centre = round(u), round(v)
        cv2.circle(result, centre, round(radius) + 2, (255, 255, 255), 1, cv2.LINE_AA)
        place = centre[0] + round(radius) + 5, centre[1] - 5
        cv2.putText(result, marker, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1)
    return result
