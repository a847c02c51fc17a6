# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Track the fish in a video file or a folder of pictures: a CSV file of poses and a picture of what was seen."""

import argparse
import csv
from collections import Counter
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from fish_report.errors import UserError
from fish_report.files import partial_file, writable_file

if TYPE_CHECKING:
    from fish_vision.tracker import Detection

HEADER = ["t", "x", "y", "heading", "std_x", "std_y", "std_heading", "spacing"]
REPEATED = "the same picture as the one before"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "video", type=Path, help="video file, or folder of pictures in order of name"
    )
    parser.add_argument("--lens", required=True, type=Path, help="camera calibration file (YAML)")
    parser.add_argument("--params", type=Path, help="params file of the tracker")
    parser.add_argument("--rate", type=float, help="frames/s (default: the video's own)")
    parser.add_argument("--out", type=Path, default=Path("poses.csv"), help="file to write")
    parser.add_argument(
        "--picture", type=Path, default=Path("tracked.png"), help="a frame, annotated"
    )


def run(args: argparse.Namespace) -> int:
    try:
        return _track(args)
    except ValueError as error:  # of lens, params, frames
        raise UserError(str(error)) from error


def _track(args: argparse.Namespace) -> int:
    """Write poses and a picture; 1 if the fish is seen nowhere."""
    from fish_vision.annotate import annotated
    from fish_vision.calibration import read_lens
    from fish_vision.config import TrackerConfig, config_from_file
    from fish_vision.detections import PoseLowPass
    from fish_vision.follower import make_follower
    from fish_vision.picture import Repeats, frames, picture_files
    from fish_vision.tracker import Detection
    from fish_vision.verbs.pictures import write_picture

    config = config_from_file(args.params) if args.params else TrackerConfig()
    calibration = config.calibration(read_lens(args.lens))
    tracker, lost, spacings = make_follower(config, calibration), Counter[str](), []
    repeats = Repeats()
    lowpass = PoseLowPass(config.lowpass_hz, config.reacquire_s)
    inputs = (*picture_files(args.video), args.lens, args.params)
    writable_file(args.picture, "--picture", inputs)
    part = partial_file(
        writable_file(args.out, inputs=inputs)
    )  # what stands there is kept until all is tracked
    with part.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow([*HEADER, *(f"tail_{i + 1}" for i in range(config.tail_links))])
        for stamp, picture in frames(args.video, args.rate, calibration.lens.size):
            if repeats.seen(picture.tobytes()):
                lost[REPEATED] += 1
                continue
            found = tracker.track(picture, stamp)
            if isinstance(found, Detection):
                rows.writerow(_row(lowpass.filtered(found)))
                spacings.append(found.spacing)
            else:
                lost[found.reason.value] += 1
            if not spacings or len(spacings) == 1:
                shown = annotated(picture, found, config, calibration)
    part.replace(args.out)
    count = len(spacings) + lost.total()
    write_picture(args.picture, shown)
    print(f"{args.out}: fish seen in {len(spacings)} of {count} frames")
    for reason, number in lost.most_common():
        print(f"lost in {number}: {reason}")
    if spacings:
        off = 100 * (sum(spacings) / len(spacings) - 1)
        what = (
            "side of the head's tag"
            if config.marker_kind == "tags"
            else "distance of the head's markers"
        )
        print(f"{what} {off:+.2f} % off on average: the scale's error")
    print(f"annotated picture: {args.picture}")
    return 0 if spacings else 1


def _row(found: "Detection") -> list[str]:
    head = found.head
    values = [found.stamp, head.x, head.y, head.heading]
    values += [float(v) ** 0.5 for v in head.covariance.diagonal()]
    return [
        f"{v:.6f}" if isfinite(v) else "" for v in [*values, found.spacing, *(found.tail or ())]
    ]
