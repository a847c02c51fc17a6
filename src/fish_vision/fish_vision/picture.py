# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures (h, w, 3; blue, green, red): from the bytes of image messages and back, from a video file or a folder, with times."""

from collections.abc import Iterator
from math import inf
from pathlib import Path

import cv2
import numpy as np

from fish_node.file_head import LARGEST_SIDE, picture_size
from fish_vision.segmentation import Image

CONVERSIONS = {  # encoding -> channels, conversion to bgr8
    "bgr8": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
}
JPEG_START, JPEG_END = b"\xff\xd8", b"\xff\xd9"
TRAILER = 64  # bytes at the end in which a JPEG must end; some cameras pad

VARIES = 2.0  # frames, by which a video's own times may differ from a constant rate
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


class PictureError(ValueError):
    """Bytes that are no usable picture; the message says what came and what was expected."""


class Repeats:
    """Notices a picture that is the same as the one before, byte by byte.

    Every camera has noise, so that a repeated picture comes from a frozen driver or a message that was sent twice.
    """

    def __init__(self) -> None:
        self._last = memoryview(b"")

    def seen(self, data: bytes) -> bool:
        """Whether the bytes of a picture are those of the one before."""
        new = memoryview(data)
        same, self._last = new == self._last, new
        return same


def from_compressed(data: bytes, size: tuple[int, int] | None) -> Image:
    """Picture from JPEG or PNG bytes; without a size any of at most LARGEST_SIDE pixels a side is taken.

    The size is judged before the picture is unpacked.

    Raises:
        PictureError: not an image, or not of the expected size (width, height).
    """
    packed = np.frombuffer(data, np.uint8)
    if packed[:2].tobytes() == JPEG_START and JPEG_END not in packed[-TRAILER:].tobytes():
        raise PictureError(f"JPEG picture cut off after {packed.size} bytes")
    said = picture_size(packed.tobytes())
    if said is None:
        raise PictureError(f"{packed.size} bytes that are no JPEG or PNG picture, or a broken one")
    _check_said(said, size)
    try:
        picture = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise PictureError(f"{packed.size} bytes that cannot be decoded: {error.err}") from error
    if picture is None:
        raise PictureError(f"{packed.size} bytes that are no JPEG or PNG picture, or a broken one")
    return picture if size is None else _of_size(picture, size)


def from_raw(
    data: bytes, encoding: str, width: int, height: int, step: int, size: tuple[int, int]
) -> Image:
    """Picture from the fields of sensor_msgs/Image (rows of `step` bytes).

    Raises:
        PictureError: unknown encoding, too few bytes, or not of the expected size (width, height).
    """
    if encoding not in CONVERSIONS:
        raise PictureError(f"encoding {encoding!r}: expected one of {', '.join(CONVERSIONS)}")
    channels, conversion = CONVERSIONS[encoding]
    if width <= 0 or height <= 0 or step < width * channels or len(data) < step * height:
        raise PictureError(
            f"{len(data)} bytes in rows of {step} for a {width} x {height} {encoding} image: "
            f"expected at least {width * channels * height} bytes in rows of at least {width * channels}"
        )
    if encoding == "yuv422_yuy2" and width % 2:
        raise PictureError(
            f"{encoding} image of width {width}: expected an even one, two pixels share a colour"
        )
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)[:, : width * channels]
    picture = np.ascontiguousarray(rows).reshape(height, width, channels)
    return _of_size(picture if conversion is None else cv2.cvtColor(picture, conversion), size)


def to_jpeg(picture: Image, quality: int = 80) -> bytes:
    """The picture as JPEG."""
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def _check_said(said: tuple[int, int], size: tuple[int, int] | None) -> None:
    """Refuse a picture whose head says another size; EXIF may turn it upright only while it is unpacked."""
    if size is None and max(said) > LARGEST_SIDE:
        raise PictureError(
            f"image of {said[0]} x {said[1]}: expected at most {LARGEST_SIDE} x {LARGEST_SIDE}"
        )
    if size is not None and said not in (size, size[::-1]):
        raise PictureError(
            f"image of {said[0]} x {said[1]}, but camera_info says {size[0]} x {size[1]}"
        )


def _of_size(picture: Image, size: tuple[int, int]) -> Image:
    height, width = picture.shape[:2]
    if (width, height) != size:
        raise PictureError(
            f"image of {width} x {height}, but camera_info says {size[0]} x {size[1]}"
        )
    return picture


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


def picture_files(path: Path) -> list[Path]:
    """The pictures of a folder in order of name; of anything else, such as a video, itself."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES)


def _folder(path: Path) -> tuple[Iterator[Image], float | None]:
    files = picture_files(path)
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
