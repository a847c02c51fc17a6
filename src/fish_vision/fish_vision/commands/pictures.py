# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures in and out of the commands: files, folders, a camera's topic; every failure is a CalibrationError."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2

from fish_vision.calibration import CalibrationError, Lens
from fish_vision.picture import PictureError
from fish_vision.segmentation import Image
from fish_vision.video import PICTURES

SILENCE_S = 10.0  # s without a picture after which a topic counts as silent


def new_file(path: Path) -> Path:
    """The path, where nothing is yet: a params file may hold keys of the user's own. Raises CalibrationError."""
    if path.exists():
        raise CalibrationError(
            f"{path}: exists already; expected a new file, as calibrate overwrites none"
        )
    return path


def write_picture(path: Path, picture: Image) -> None:
    """Picture to a file; CalibrationError if that cannot be."""
    try:
        written = cv2.imwrite(str(path), picture)
    except cv2.error as error:
        raise CalibrationError(
            f"{path}: no name of a picture, expected like checked.png ({error.err})"
        ) from error
    if not written:
        raise CalibrationError(f"{path}: cannot be written")


def read_picture(path: Path) -> Image:
    """Picture from a file."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise CalibrationError(f"{path}: no such picture, or not one that OpenCV reads")
    return picture


def read_pictures(paths: Sequence[Path]) -> list[Image]:
    """Pictures from files, and from all picture files of folders in order of name."""
    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES)
        if not inside:
            raise CalibrationError(f"{path}: no pictures in it, expected {', '.join(PICTURES)}")
        files += inside
    return [read_picture(file) for file in files]


def from_topic(topic: str, count: int, accept: Callable[[Image], bool]) -> list[Image]:
    """The first pictures of a topic that are accepted. Needs ROS."""
    from fish_vision.nodes.picture_source import collect

    try:
        return collect(topic, accept, count, SILENCE_S)
    except PictureError as error:
        raise CalibrationError(str(error)) from error


def add_picture_arguments(parser: argparse.ArgumentParser) -> None:
    """--image and --topic: where the one picture of a command comes from."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--image", type=Path, help="picture file of the camera")
    source.add_argument("--topic", help="take the picture from this topic of a running camera")


def one_picture(args: argparse.Namespace, lens: Lens) -> Image | None:
    """The picture that --image or --topic names, None without them; its size must be the lens file's."""
    if args.image is None and args.topic is None:
        return None
    if args.image is not None:
        picture = read_picture(args.image)
    else:
        picture = from_topic(args.topic, 1, lambda _: True)[0]
    require_size(picture, lens, str(args.image or args.topic))
    return picture


def require_size(picture: Image, lens: Lens, name: str) -> None:
    """Raise CalibrationError if a picture is not of the lens's size."""
    if picture.shape[1::-1] != lens.size:
        raise CalibrationError(
            f"{name}: size {picture.shape[1::-1]}, but the lens file says {lens.size}"
        )
