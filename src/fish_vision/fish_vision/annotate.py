# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures for people: with what the tracker saw in it, or with the pixels that colour ranges hold."""

import itertools
from collections.abc import Mapping, Sequence
from math import cos, sin

import cv2
import numpy as np

from fish_vision.calibration import POOL, Calibration
from fish_vision.config import TrackerConfig
from fish_vision.segmentation import ColourRange, Image, hsv_of
from fish_vision.tracker import Detection, Lost

GREEN, RED, WHITE = (60, 230, 60), (50, 50, 255), (255, 255, 255)  # blue, green, red
ARROW = 0.25  # m, length of the drawn heading


def annotated(
    image: Image, found: Detection | Lost, config: TrackerConfig, calibration: Calibration
) -> Image:
    """Copy of an image with the pool's outline, box, head, heading, tail, numbers (or the reason)."""
    picture = drawn_pool(image, calibration)
    if isinstance(found, Lost):
        return _text(picture, f"lost: {found.reason.value}", RED)
    head = found.head
    cv2.rectangle(picture, found.box[:2], found.box[2:], GREEN, 1)
    centre, ahead = np.array([head.x, head.y]), np.array([cos(head.heading), sin(head.heading)])
    _line(picture, calibration, np.array([centre, centre + ARROW * ahead]), GREEN)
    _line(picture, calibration, tail_points(found, config), GREEN)
    numbers = f"x {head.x:+.3f} m  y {head.y:+.3f} m  heading {head.heading:+.3f} rad  spacing {found.spacing:.3f}"
    if found.tail is not None:
        numbers += "  tail " + " ".join(f"{angle:+.2f}" for angle in found.tail)
    return _text(picture, numbers, WHITE)


def drawn_pool(image: Image, calibration: Calibration, sides: tuple[float, float] = POOL) -> Image:
    """Copy of an image with the pool's outline; sides: along x and y, m."""
    picture = image.copy()
    _line(picture, calibration, _outline(sides), WHITE, closed=True)
    return picture


def tinted(picture: Image, found: Mapping[str, Sequence[int]]) -> Image:
    """Copy of a picture, grey but for the pixels in the ranges found."""
    hsv = hsv_of(picture, (0, 0, picture.shape[1], picture.shape[0]))
    masks = [ColourRange(*colour).mask(hsv) > 0 for colour in found.values()]
    grey = cv2.cvtColor(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    held = np.any(masks, axis=0)
    result: Image = grey // 2
    result[held] = picture[held]
    return result


def tail_points(found: Detection, config: TrackerConfig) -> np.ndarray:
    """(N, 2) head's centre of mass, hinge and far ends of the links in the pool, m."""
    angle, place = found.head.heading, np.array([found.head.x, found.head.y])
    points = [place, place - config.hinge_offset * np.array([cos(angle), sin(angle)])]
    for relative in found.tail or ():
        angle += relative
        points.append(points[-1] - config.link_length * np.array([cos(angle), sin(angle)]))
    return np.array(points)


def _outline(walls: tuple[float, float], points: int = 20) -> np.ndarray:
    """(N, 2) points along the pool's walls, m: many, because the lens bends them."""
    x, y = walls[0] / 2, walls[1] / 2
    corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y], [x, y]])
    sides = itertools.pairwise(corners)
    return np.vstack([np.linspace(a, b, points, endpoint=False) for a, b in sides])


def _line(
    picture: Image,
    calibration: Calibration,
    points: np.ndarray,
    colour: tuple[int, int, int],
    closed: bool = False,
) -> None:
    pixels = np.round(calibration.pool_to_pixel(points) * 16).astype(np.int32)
    cv2.polylines(picture, [pixels], closed, colour, 1, cv2.LINE_AA, shift=4)


def _text(picture: Image, text: str, colour: tuple[int, int, int]) -> Image:
    cv2.rectangle(picture, (0, 0), (picture.shape[1], 34), (40, 40, 40), cv2.FILLED)
    cv2.putText(picture, text, (12, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 1, cv2.LINE_AA)
    return picture
