# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate colours: colour ranges from pictures of the fish in today's light, proposed or picked on a page.

Proposed: the fish is found by the places of its markers, whatever their colours.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from fish_vision.annotate import tinted
from fish_vision.calibration import Calibration, CalibrationError, Lens, read_lens
from fish_vision.config import TrackerConfig, config_from_file
from fish_vision.heads import Head, HeadFinder
from fish_vision.pose import Spot, link_ends
from fish_vision.segmentation import HUES, Image, hsv_of
from fish_vision.spots import CANDIDATES, MARKERS, SpotFinder
from fish_vision.tracker import Detection, Tracker
from fish_vision.verbs.pictures import (
    PickingPage,
    Points,
    from_topic,
    new_file,
    read_pictures,
    require_size,
    write_picture,
)

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


def add_parser(verbs: Any) -> None:
    """The sub-command."""
    colours = verbs.add_parser(
        "colours", help="colour ranges from pictures that show the fish with all its markers"
    )
    colours.add_argument("pictures", nargs="*", type=Path, help="picture files, or folders of them")
    colours.add_argument("--topic", help="take one picture from this topic of a running camera")
    colours.add_argument("--lens", required=True, type=Path, help="camera calibration file (YAML)")
    colours.add_argument("--params", type=Path, help="params file of the tracker with the mount")
    colours.add_argument(
        "--page",
        action="store_true",
        help="click the markers in the first picture, on a page that shows at once what the colours hold",
    )
    colours.add_argument("--port", type=int, default=0, help="of the page; 0 takes a free one")
    colours.add_argument(
        "--out", type=Path, default=Path("colours.yaml"), help="params file for the tracker"
    )
    colours.add_argument(
        "--picture", type=Path, default=Path("colours.png"), help="the first fish found, marked"
    )
    colours.set_defaults(calibrate=calibrate_colours)


def calibrate_colours(args: argparse.Namespace) -> None:
    """Write a params file with the four colours, and a picture of what they were taken from."""
    out, marked = new_file(args.out), new_file(args.picture)
    try:
        config = config_from_file(args.params) if args.params else TrackerConfig()
    except ValueError as error:
        raise CalibrationError(str(error)) from error
    lens = read_lens(args.lens)
    calibration = config.calibration(lens)
    pictures = _pictures(args, lens)
    sightings: list[Sighting | None]
    if args.page:
        sighting = _picked(pictures[0], config, calibration, args.port)
        found, sightings = ranges([pictures[0]], [sighting]), [sighting]
    else:
        found, sightings = propose(pictures, config, calibration)
    first = next(i for i, sighting in enumerate(sightings) if sighting)
    write_picture(marked, drawn(pictures[first], sightings[first]))
    values = {f"{marker}_colour": colour for marker, colour in found.items()}
    out.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    for name, colour in values.items():
        print(f"{name:17s} {colour}")
    own: dict[str, Any] = {name: tuple(colour) for name, colour in values.items()}
    print(_error(pictures, replace(config, **own), calibration))
    count = sum(sighting is not None for sighting in sightings)
    print(f"{out}: fish found in {count} of {len(pictures)} pictures; {marked} shows the first")


def _pictures(args: argparse.Namespace, lens: Lens) -> list[Image]:
    if bool(args.pictures) == bool(args.topic):
        raise CalibrationError("expected picture files or folders, or --topic, and not both")
    if args.topic:
        pictures = from_topic(args.topic, 1, lambda _: True)
    else:
        pictures = read_pictures(args.pictures)
    for number, picture in enumerate(pictures, 1):
        require_size(picture, lens, args.topic or f"picture {number}")
    return pictures


def _picked(picture: Image, config: TrackerConfig, calibration: Calibration, port: int) -> Sighting:
    """Markers that a person clicks."""
    markers = MARKERS[: 2 + min(config.tail_links, 2)]

    def preview(points: Points) -> tuple[str, Image | None]:
        if not points:
            return "", None
        found = ranges([picture], [clicked(points, config, calibration)])
        lines = [f"{marker}: {colour}" for marker, colour in found.items()]
        return "\n".join(lines), tinted(picture, found)

    page = PickingPage(picture, markers, preview, port)
    print(f"open {page.address} and click the middles of {len(markers)} markers", flush=True)
    return clicked(page.wait(), config, calibration)


def _error(pictures: list[Image], config: TrackerConfig, calibration: Calibration) -> str:
    """How far off the head's markers are from their known distance in these colours."""
    seen = [Tracker(config, calibration).track(picture, 0.0) for picture in pictures]
    off = [config.layout().spacing * (s.spacing - 1) for s in seen if isinstance(s, Detection)]
    if not off:
        return "the tracker sees the fish in none of the pictures with these colours: check the marked picture"
    rms = 1e3 * float(np.sqrt(np.mean(np.square(off))))
    scale = calibration.place_and_scale(calibration.pool_to_pixel([[0.0, 0.0]]))[1][0]
    pixels = rms / 1e3 / float(np.sqrt(abs(np.linalg.det(scale))))
    return (
        f"the tracker sees the fish in {len(off)} of {len(pictures)} pictures; error of the head markers' distance "
        f"{pixels:.2f} pixels rms, {rms:.1f} mm on the water plane"
    )
