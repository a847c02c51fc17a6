# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate lens | mount | colours: make the files that tell the tracker about its camera and its light."""

import argparse
import csv
import sys
from math import inf
from pathlib import Path

import cv2
import numpy as np
import yaml

from fish_vision.calibrate import lens_from_chessboards, mount_from_points
from fish_vision.calibration import Calibration, CalibrationError, lens_document, read_lens
from fish_vision.colour_ranges import drawn, propose
from fish_vision.config import TrackerConfig, config_from_file

RMS_LIMIT = 5.0  # pixels; worse points are swapped or mistyped


def arguments() -> argparse.ArgumentParser:
    """Command line."""
    parser = argparse.ArgumentParser(prog="calibrate", description=__doc__)
    add_verbs(parser)
    return parser


def add_verbs(parser: argparse.ArgumentParser) -> None:
    """Sub-commands of calibrate; each sets `calibrate`, the function to call."""
    verbs = parser.add_subparsers(required=True)
    lens = verbs.add_parser("lens", help="camera matrix and distortion from chessboard pictures")
    lens.add_argument("pictures", nargs="+", type=Path)
    lens.add_argument("--corners", required=True, help="inner corners, for example 8x6")
    lens.add_argument("--square", required=True, type=float, help="side of a square, m")
    lens.add_argument(
        "--out", type=Path, default=Path("lens.yaml"), help="calibration_file of the camera node"
    )
    lens.set_defaults(calibrate=calibrate_lens)
    mount = verbs.add_parser(
        "mount", help="position and tilt of the camera from known points of the pool"
    )
    mount.add_argument(
        "points", type=Path, help="CSV with header x,y,u,v: pool frame, m, and pixels"
    )
    mount.add_argument("--lens", required=True, type=Path, help="file written by `calibrate lens`")
    mount.add_argument("--height", type=float, default=0.0, help="of the points above the water, m")
    mount.add_argument(
        "--out", type=Path, default=Path("mount.yaml"), help="params file for the tracker"
    )
    mount.set_defaults(calibrate=calibrate_mount)
    colours = verbs.add_parser(
        "colours", help="colour ranges from pictures that show the fish with all its markers"
    )
    colours.add_argument("pictures", nargs="+", type=Path)
    colours.add_argument("--lens", required=True, type=Path, help="camera calibration file (YAML)")
    colours.add_argument("--params", type=Path, help="params file of the tracker with the mount")
    colours.add_argument(
        "--out", type=Path, default=Path("colours.yaml"), help="params file for the tracker"
    )
    colours.add_argument(
        "--picture", type=Path, default=Path("colours.png"), help="the first fish found, marked"
    )
    colours.set_defaults(calibrate=calibrate_colours)


def new_file(path: Path) -> Path:
    """The path, where nothing is yet: a params file may hold keys of the user's own. Raises CalibrationError."""
    if path.exists():
        raise CalibrationError(
            f"{path}: exists already; expected a new file, as calibrate overwrites none"
        )
    return path


def calibrate_lens(args: argparse.Namespace) -> None:
    """Write a camera calibration file."""
    out = new_file(args.out)
    sides = args.corners.lower().split("x")
    if (
        len(sides) != 2
        or not all(s.isdigit() and int(s) > 2 for s in sides)
        or not 0.0 < args.square < inf
    ):
        raise CalibrationError(
            f"--corners {args.corners} --square {args.square}: expected like 8x6 and 0.03"
        )
    pictures = [read_picture(path) for path in args.pictures]
    lens, rms, used = lens_from_chessboards(pictures, (int(sides[0]), int(sides[1])), args.square)
    out.write_text(yaml.safe_dump(lens_document(lens, "overhead"), sort_keys=False))
    print(
        f"{args.out}: board found in {len(used)} of {len(pictures)} pictures, error {rms:.3f} pixels rms"
    )


def calibrate_mount(args: argparse.Namespace) -> None:
    """Write a params file with camera_position and camera_tilt."""
    out = new_file(args.out)
    rows = read_points(args.points)
    points = np.column_stack([rows[:, :2], np.full(len(rows), args.height)])
    mount, rms = mount_from_points(read_lens(args.lens), points, rows[:, 2:])
    if rms > RMS_LIMIT:
        raise CalibrationError(
            f"{args.points}: the points fit to {rms:.1f} pixels rms only: expected below {RMS_LIMIT}; "
            "a point is mistaken or the lens file is of another camera"
        )
    values = {"camera_position": list(mount.position), "camera_tilt": list(mount.tilt)}
    out.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    print(
        f"{args.out}: {len(rows)} points, error {rms:.2f} pixels rms, camera {mount.position[2]:.3f} m high"
    )


def calibrate_colours(args: argparse.Namespace) -> None:
    """Write a params file with the four colours, and a picture of what they were taken from."""
    out, marked = new_file(args.out), new_file(args.picture)
    try:
        config = config_from_file(args.params) if args.params else TrackerConfig()
    except ValueError as error:
        raise CalibrationError(str(error)) from error
    lens = read_lens(args.lens)
    calibration = Calibration(lens, config.mount(), config.marker_height)
    pictures = [read_picture(path) for path in args.pictures]
    for path, picture in zip(args.pictures, pictures, strict=True):
        if picture.shape[1::-1] != lens.size:
            raise CalibrationError(
                f"{path}: size {picture.shape[1::-1]}, but {args.lens} says {lens.size}"
            )
    ranges, sightings = propose(pictures, config, calibration)
    first = next(i for i, sighting in enumerate(sightings) if sighting)
    write_picture(marked, drawn(pictures[first], sightings[first]))
    values = {f"{marker}_colour": colour for marker, colour in ranges.items()}
    out.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    for name, colour in values.items():
        print(f"{name:17s} {colour}")
    found = sum(sighting is not None for sighting in sightings)
    print(f"{out}: fish found in {found} of {len(pictures)} pictures; {marked} shows the first")


def write_picture(path: Path, picture: np.ndarray) -> None:
    """Picture to a file; CalibrationError if that cannot be."""
    try:
        written = cv2.imwrite(str(path), picture)
    except cv2.error as error:
        raise CalibrationError(
            f"{path}: no name of a picture, expected like checked.png ({error.err})"
        ) from error
    if not written:
        raise CalibrationError(f"{path}: cannot be written")


def read_picture(path: Path) -> np.ndarray:
    """Picture from a file."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise CalibrationError(f"{path}: no such picture, or not one that OpenCV reads")
    return picture


def read_points(path: Path) -> np.ndarray:
    """(N, 4) x, y, u, v from a CSV file with a header."""
    try:
        with path.open(newline="") as file:
            rows = [
                [float(row[key]) for key in ("x", "y", "u", "v")] for row in csv.DictReader(file)
            ]
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError) as error:
        raise CalibrationError(
            f"{path}: expected CSV with header x,y,u,v and numbers ({error})"
        ) from error
    points = np.array(rows).reshape(-1, 4)
    if not np.isfinite(points).all():
        line = (
            int(np.argmin(np.isfinite(points).all(axis=1))) + 2
        )  # after the header, counted from 1
        raise CalibrationError(f"{path}: line {line} has {rows[line - 2]}: expected finite numbers")
    return points


def main() -> int:
    """Entry point."""
    args = arguments().parse_args()
    try:
        args.calibrate(args)
    except (CalibrationError, OSError) as error:
        print(f"calibrate: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
