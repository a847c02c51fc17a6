# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""check_image: what the tracker sees in one picture; for setting colours and checking a calibration."""

import argparse
import sys
from pathlib import Path

import numpy as np

from fish_report.errors import UserError
from fish_report.files import keep_inputs
from fish_vision.annotate import annotated
from fish_vision.calibration import Calibration, read_lens
from fish_vision.config import TrackerConfig, config_from_file
from fish_vision.follower import make_follower
from fish_vision.segmentation import hsv_of
from fish_vision.spots import SpotFinder
from fish_vision.tracker import Lost
from fish_vision.verbs.pictures import read_picture, write_picture

MARKERS = ("front", "rear", "tail_odd", "tail_even")


def arguments() -> argparse.ArgumentParser:
    """Command line."""
    parser = argparse.ArgumentParser(prog="check_image", description=__doc__)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--lens", required=True, type=Path, help="camera calibration file (YAML)")
    parser.add_argument(
        "--params", type=Path, help="params file of the tracker; defaults without it"
    )
    parser.add_argument("--out", type=Path, default=Path("checked.png"), help="annotated picture")
    return parser


def check(args: argparse.Namespace) -> int:
    """Print what is found, write the annotated picture; 0 if the fish is seen."""
    keep_inputs([args.out], (args.picture, args.lens, args.params))
    config = config_from_file(args.params) if args.params else TrackerConfig()
    lens, picture = read_lens(args.lens), read_picture(args.picture)
    if picture.shape[1::-1] != lens.size:
        raise ValueError(
            f"{args.picture} has size {picture.shape[1::-1]}, {args.lens} says {lens.size}"
        )
    calibration = config.calibration(lens)
    if config.marker_kind == "colours":
        print_colours(picture, config, calibration)
    found = make_follower(config, calibration).track(picture, 0.0)
    if isinstance(found, Lost):
        print(f"lost: {found.reason.value}")
    else:
        head, std = found.head, np.sqrt(np.diag(found.head.covariance))
        print(
            f"head {head.x:+.4f} {head.y:+.4f} m, heading {head.heading:+.4f} rad, std {std.round(5)}"
        )
        print(f"size of what is on the head {found.spacing:.4f} of the true one")
        print(
            f"tail {'not seen' if found.tail is None else [round(angle, 3) for angle in found.tail]}"
        )
    write_picture(args.out, annotated(picture, found, config, calibration))
    print(f"annotated picture: {args.out}")
    return 1 if isinstance(found, Lost) else 0


def print_colours(picture: np.ndarray, config: TrackerConfig, calibration: Calibration) -> None:
    """For each marker colour: pixels in range, their middle colour, spots of the right size."""
    hsv = hsv_of(picture, (0, 0, picture.shape[1], picture.shape[0]))
    finder = SpotFinder(config, calibration)
    for marker in MARKERS:
        inside = hsv[config.colour(marker).mask(hsv) > 0]
        middle = np.median(inside, axis=0).astype(int).tolist() if len(inside) else "none"
        spots = [
            np.round(spot.position, 3).tolist() for spot in finder.find(hsv, [marker], (0, 0))[0]
        ]
        print(
            f"{marker:9s} {len(inside):6d} pixels in range, middle HSV {middle}, spots at {spots}"
        )


def main() -> int:
    """Entry point."""
    try:
        return check(arguments().parse_args())
    except (UserError, ValueError, OSError) as error:
        print(f"check_image: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    raise SystemExit(main())
