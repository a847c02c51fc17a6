# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate colours: colour ranges from pictures of the fish in today's light, proposed or picked on a page."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fish_vision.calibration import Calibration, CalibrationError, Lens, read_lens
from fish_vision.colour_ranges import Sighting, clicked, drawn, propose, ranges, tinted
from fish_vision.colours import MARKERS
from fish_vision.commands.pictures import (
    from_topic,
    new_file,
    read_pictures,
    require_size,
    write_picture,
)
from fish_vision.config import TrackerConfig, config_from_file
from fish_vision.picking import PickingPage, Points
from fish_vision.segmentation import Image
from fish_vision.tracker import Detection, Tracker


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
