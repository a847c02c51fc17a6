# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures for the tests: discs in a pool seen straight down through a lens without distortion."""

from math import cos, sin

import numpy as np

from fish_vision.calibration import Calibration, Lens
from fish_vision.config import TrackerConfig

SIZE, SCALE = (1280, 720), 300.0  # pixels, pixels per metre
WATER, BODY = (190, 165, 90), (52, 50, 50)
COLOURS = {
    "front": (0, 215, 255),
    "rear": (210, 20, 235),
    "odd": (35, 55, 240),
    "even": (40, 205, 45),
    "blue": (200, 60, 20),
    "orange": (0, 140, 255),
}
HEIGHT = 3.0  # m; with 900 pixels of focal length gives SCALE
CONFIG = TrackerConfig(camera_position=(0.0, 0.0, HEIGHT), camera_tilt=(0.0, 0.0, 0.0))


def lens_fields() -> tuple[int, int, str, list[float], list[float]]:
    """Fields of the camera_info message."""
    return (*SIZE, "plumb_bob", [900.0, 0.0, 640.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0], [0.0] * 5)


def calibration() -> Calibration:
    """The camera of these pictures."""
    return Calibration(Lens.from_camera_info(*lens_fields()), CONFIG.mount())


def discs_of_fish(
    x: float, y: float, heading: float, tail: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> list:
    """(x, y, diameter, colour name) of every marker, m."""
    ahead = np.array([cos(heading), sin(heading)])
    head = np.array([x, y])
    discs = [(*(head + 0.045 * ahead), 0.03, "front"), (*(head - 0.045 * ahead), 0.03, "rear")]
    place, angle = head - 0.075 * ahead, heading
    for i, bend in enumerate(tail):
        angle += bend
        place = place - 0.07 / 3 * np.array([cos(angle), sin(angle)])
        discs.append((*place, 0.016, "even" if i % 2 else "odd"))
    return discs


def draw(discs: list, noise: float = 2.0, seed: int = 0) -> np.ndarray:
    """(720, 1280, 3) water with discs, each on a piece of black body; 8 x 8 subpixels per pixel."""
    picture = np.empty((SIZE[1], SIZE[0], 3))
    picture[:] = WATER
    for x, y, diameter, _ in discs:
        _disc(picture, x, y, diameter + 0.02, BODY)
    for x, y, diameter, colour in discs:
        _disc(picture, x, y, diameter, COLOURS[colour])
    picture += np.random.default_rng(seed).normal(0.0, noise, (1, SIZE[0], 3))
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def _disc(
    picture: np.ndarray, x: float, y: float, diameter: float, colour: tuple[int, int, int]
) -> None:
    u_0, v_0, r = 640.0 + SCALE * x, 360.0 - SCALE * y, SCALE * diameter / 2
    left, top = max(int(u_0 - r) - 2, 0), max(int(v_0 - r) - 2, 0)
    right, bottom = min(int(u_0 + r) + 3, SIZE[0]), min(int(v_0 + r) + 3, SIZE[1])
    fine = 8
    u = (np.arange(left * fine, right * fine) + 0.5) / fine - 0.5
    v = (np.arange(top * fine, bottom * fine) + 0.5) / fine - 0.5
    inside = ((u[None, :] - u_0) ** 2 + (v[:, None] - v_0) ** 2 < r * r).astype(float)
    cover = inside.reshape(bottom - top, fine, right - left, fine).mean(axis=(1, 3))[..., None]
    part = picture[top:bottom, left:right]
    part[:] = part * (1 - cover) + np.array(colour) * cover


def with_tag(
    picture: np.ndarray, tag: np.ndarray, x: float, y: float, turn: float, size: float
) -> np.ndarray:
    """Copy of a picture with a printed tag and its white rim of one cell, 8 x 8 subpixels per pixel.

    tag: (cells, cells) 0 or 255. turn: of the tag's right against pool x, rad. size: of the black square, m.
    """
    result, fine = picture.copy(), 8
    printed, cells = np.pad(tag, 1, constant_values=255), len(tag)
    reach = SCALE * size * (1 + 2 / cells) * 0.75 + 2
    u_0, v_0 = 640.0 + SCALE * x, 360.0 - SCALE * y
    left, right = int(u_0 - reach), int(u_0 + reach)
    top, bottom = int(v_0 - reach), int(v_0 + reach)
    u = (np.arange(left * fine, right * fine) + 0.5) / fine - 0.5 - u_0
    v = (np.arange(top * fine, bottom * fine) + 0.5) / fine - 0.5 - v_0
    ahead, up = u[None, :] / SCALE, -v[:, None] / SCALE
    column = (cos(turn) * ahead + sin(turn) * up) * cells / size + cells / 2 + 1
    row = (sin(turn) * ahead - cos(turn) * up) * cells / size + cells / 2 + 1
    inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < cells + 2)
    index = np.clip(np.stack([row, column]), 0, cells + 1).astype(int)
    grey = np.where(inside, printed[index[0], index[1]] * 0.85 + 15.0, 0.0)
    shape = (bottom - top, fine, right - left, fine)
    cover = inside.astype(float).reshape(shape).mean(axis=(1, 3))[..., None]
    part = result[top:bottom, left:right]
    part[:] = np.round(part * (1 - cover) + grey.reshape(shape).mean(axis=(1, 3))[..., None])
    return result
