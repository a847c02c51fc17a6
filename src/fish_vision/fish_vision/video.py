# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frames of a video file or of a folder of pictures, with their times."""

from collections.abc import Iterator
from math import inf
from pathlib import Path

import cv2

from fish_vision.picture import PictureError
from fish_vision.segmentation import Image

VARIES = 2.0  # frames, by which a video's own times may differ from a constant rate
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def frames(path: Path, rate: float | None, size: tuple[int, int]) -> Iterator[tuple[float, Image]]:
    """Time since the first frame, s, and picture (h, w, 3; blue, green, red) of every frame.

    Args:
        path: video file, or folder of pictures in order of name.
        rate: frames/s; None: the video's own.
        size: width, height that the lens was calibrated for.

    Raises:
        PictureError: nothing to read, no rate or one that varies, or frames of another size.
    """
    if rate is not None and not 0.0 < rate < inf:
        raise PictureError(f"--rate {rate}: expected a positive number of frames/s")
    source, own = _folder(path) if path.is_dir() else _video(path, rate is None)
    rate = rate or own
    if not rate or not 0.0 < rate < inf:
        raise PictureError(f"{path} says no frame rate: expected --rate")
    count = 0
    for picture in source:
        if picture.shape[1::-1] != size:
            raise PictureError(
                f"{path}: frame {count} has size {picture.shape[1::-1]}, but the lens file says {size}"
            )
        yield count / rate, picture
        count += 1
    if not count:
        raise PictureError(f"{path}: no frame in it that OpenCV reads")


def _folder(path: Path) -> tuple[Iterator[Image], float | None]:
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES)
    if not files:
        raise PictureError(f"{path}: no pictures in it, expected {', '.join(PICTURES)}")

    def read() -> Iterator[Image]:
        for file in files:
            picture = cv2.imread(str(file), cv2.IMREAD_COLOR)
            if picture is None:
                raise PictureError(f"{file}: not a picture that OpenCV reads")
            yield picture

    return read(), None


def _video(path: Path, own_rate: bool) -> tuple[Iterator[Image], float | None]:
    if not path.is_file():
        raise PictureError(f"{path}: no such video or folder")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise PictureError(f"{path}: not a video that OpenCV reads")
    rate = float(capture.get(cv2.CAP_PROP_FPS))

    def read() -> Iterator[Image]:
        count = 0
        try:
            while True:
                able, picture = capture.read()
                if not able:
                    return
                at = 1e-3 * float(capture.get(cv2.CAP_PROP_POS_MSEC))  # s; 0 where it is not known
                frames_off = at * rate - count
                if own_rate and at > 0.0 and abs(frames_off) > VARIES:
                    raise PictureError(
                        f"{path}: frame {count} comes {frames_off:+.0f} frames off a constant {rate:g} frames/s; "
                        "convert it to a constant rate, or say --rate if its times do not count"
                    )
                yield picture
                count += 1
        finally:
            capture.release()

    return read(), rate
