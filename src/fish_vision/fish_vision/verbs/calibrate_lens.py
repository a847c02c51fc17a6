# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate lens: camera matrix and distortion from chessboard pictures of files, of folders, or of a topic."""

import argparse
from math import inf
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from fish_vision.calibrate import LensFit, find_board, lens_from_chessboards
from fish_vision.calibration import CalibrationError, Lens, lens_document
from fish_vision.segmentation import Image
from fish_vision.verbs.pictures import from_topic, new_file, read_pictures, write_picture

MOVED = 0.06  # share of the picture's width by which a board must have moved to be another view
LARGE_RMS = 0.5  # pixels; a usual camera gives less than 0.3
ENLARGED = 20  # how much longer the drawn errors are than they are
SEEN, ERROR = (90, 220, 90), (60, 60, 255)  # blue, green, red


def add_parser(verbs: Any) -> None:
    """The sub-command."""
    lens = verbs.add_parser("lens", help="camera matrix and distortion from chessboard pictures")
    lens.add_argument("pictures", nargs="*", type=Path, help="picture files, or folders of them")
    lens.add_argument("--topic", help="take the pictures from this topic of a running camera")
    lens.add_argument(
        "--count", type=int, default=20, help="views of the board to take from the topic"
    )
    lens.add_argument("--corners", required=True, help="inner corners, for example 8x6")
    lens.add_argument("--square", required=True, type=float, help="side of a square, m")
    lens.add_argument(
        "--fisheye", action="store_true", help="distortion model equidistant, for very wide lenses"
    )
    lens.add_argument(
        "--out", type=Path, default=Path("lens.yaml"), help="calibration_file of the camera node"
    )
    lens.add_argument(
        "--picture", type=Path, default=Path("lens.png"), help="boards and errors, drawn"
    )
    lens.set_defaults(calibrate=calibrate_lens)


def calibrate_lens(args: argparse.Namespace) -> None:
    """Write a camera calibration file and a picture of where the boards were; nothing of a lens that cannot be."""
    out, marked = new_file(args.out), new_file(args.picture)
    corners = _corners(args)
    if bool(args.pictures) == bool(args.topic):
        raise CalibrationError("expected picture files or folders, or --topic, and not both")
    if args.topic:
        print(f"move the board: {args.count} views of it are taken from {args.topic}", flush=True)
        pictures = from_topic(args.topic, args.count, NewViews(corners).accept)
    else:
        pictures = read_pictures(args.pictures)
    fit = lens_from_chessboards(pictures, corners, args.square, args.fisheye)
    found = fit.lens
    Lens.from_camera_info(*found.size, found.model, found.K.ravel().tolist(), found.D.tolist())
    write_picture(marked, drawn(pictures[fit.used[0]], fit))
    out.write_text(yaml.safe_dump(lens_document(fit.lens, "overhead"), sort_keys=False))
    each_metre = 1e3 * fit.rms / float(np.sqrt(fit.lens.K[0, 0] * fit.lens.K[1, 1]))
    print(
        f"{out}: board found in {len(fit.used)} of {len(pictures)} pictures, error {fit.rms:.3f} pixels rms, "
        f"{each_metre:.2f} mm on the water for each metre of the camera's height; {marked} shows it"
    )
    if fit.rms > LARGE_RMS:
        print(
            f"the error is large: expected below {LARGE_RMS} pixels; take sharp pictures of one camera at one focus, and a board "
            "that is flat"
        )


def _corners(args: argparse.Namespace) -> tuple[int, int]:
    sides = args.corners.lower().split("x")
    if (
        len(sides) != 2
        or not all(s.isdigit() and int(s) > 2 for s in sides)
        or not 0.0 < args.square < inf
    ):
        raise CalibrationError(
            f"--corners {args.corners} --square {args.square}: expected like 8x6 and 0.03"
        )
    return int(sides[0]), int(sides[1])


class NewViews:
    """Takes pictures whose board is elsewhere than in all pictures before."""

    def __init__(self, corners: tuple[int, int]) -> None:
        self._corners = corners
        self._views: list[np.ndarray] = []

    def accept(self, picture: Image) -> bool:
        """Whether the picture shows the board in a new place or tilt."""
        board = find_board(picture, self._corners)
        if board is None:
            return False
        far = MOVED * picture.shape[1]
        if any(np.abs(board - view).max() < far for view in self._views):
            return False
        self._views.append(board)
        print(f"view {len(self._views)}", flush=True)
        return True


def drawn(picture: Image, fit: LensFit) -> Image:
    """Copy of a picture with the corners of all boards and their errors, ENLARGED times as long."""
    result = picture.copy()
    for seen, shown in zip(np.vstack(fit.seen), np.vstack(fit.shown), strict=True):
        start, end = (np.round(p).astype(int) for p in (seen, seen + ENLARGED * (shown - seen)))
        cv2.circle(result, start.tolist(), 2, SEEN, 1, cv2.LINE_AA)
        cv2.line(result, start.tolist(), end.tolist(), ERROR, 1, cv2.LINE_AA)
    return result
