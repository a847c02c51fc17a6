# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The empty pool from above: still picture, and the light that moves on floor and surface."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_node.pool import LENGTH, WIDTH
from fish_sim.camera.model import CameraModel

Array = NDArray[Any]  # float64
Image = NDArray[Any]  # uint8, (h, w, 3) or (h, w)

POOL = (LENGTH, WIDTH)
DEPTH = 0.6  # m, of the drawn floor; appearance only
RIM = 0.05  # m, width of the wall's top
TILE = 0.305  # m, floor tiles
REFRACTION = 1.333  # index of water

FLOOR, GROUT, WALL = (196, 172, 96), (172, 148, 78), (168, 140, 70)  # blue, green, red
TOP, DECK, LANE = (205, 205, 200), (112, 116, 118), (150, 112, 42)


def still_pool(camera: CameraModel, seed: int) -> Image:
    """(height, width, 3) picture of the pool at rest: rim, walls, tiled floor seen through the water."""
    width, height = camera.size
    rays = _all_rays(camera)
    x, y, z = camera.position
    surface = np.array([x, y], np.float32) - rays[:, :2] * (z / rays[:, 2])[:, None]
    colour = _colours(surface, _through_water(surface, rays), z / camera.focal[0])
    coarse = (
        np.random.default_rng(seed)
        .normal(0.0, 2.0, (height // 8 + 1, width // 8 + 1))
        .astype(np.float32)
    )
    grain = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC).reshape(-1, 1)
    picture: Array = (colour + grain).reshape(height, width, 3) * vignette(camera)[..., None]
    return cv2.GaussianBlur(np.clip(picture, 0, 255).astype(np.uint8), (3, 3), 0)


def _all_rays(camera: CameraModel, step: int = 8) -> Array:
    """(height * width, 3) directions of all pixels: exact at every step-th, bilinear between (0.01 pixel)."""
    width, height = camera.size
    u, v = np.meshgrid(np.arange(0, width + step, step), np.arange(0, height + step, step))
    coarse = (
        camera.rays(np.column_stack([u.ravel(), v.ravel()])).reshape(*u.shape, 3).astype(np.float32)
    )
    column, row = np.meshgrid(
        np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    )
    return cv2.remap(coarse, column / step, row / step, cv2.INTER_LINEAR).reshape(-1, 3)


def vignette(camera: CameraModel) -> Array:
    """(height, width) share of light that the lens passes: cos^4 of the angle off axis, softened."""
    width, height = camera.size
    (fx, fy), (cx, cy) = camera.focal, camera.centre
    u, v = (np.arange(width) - cx) / fx, (np.arange(height) - cy) / fy
    return (1.0 + u[None, :] ** 2 + v[:, None] ** 2) ** -0.8


def _through_water(surface: Array, rays: Array) -> Array:
    """(N, 3) points on floor or wall where refracted rays end; Snell: sin(after) = sin(before) / n."""
    flat = np.hypot(rays[:, 0], rays[:, 1])
    sine = flat / np.hypot(flat, rays[:, 2]) / REFRACTION
    slope = sine / np.sqrt(1.0 - sine**2)
    sideways = rays[:, :2] / np.maximum(flat, 1e-12)[:, None] * slope[:, None]  # m per m of depth
    half = np.array(POOL, np.float32) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (np.sign(sideways) * half - surface) / sideways
    to_wall = np.where(to_wall >= 0, to_wall, np.inf)
    depth = np.minimum(DEPTH, np.minimum(to_wall[:, 0], to_wall[:, 1]))
    return np.column_stack([surface + sideways * depth[:, None], -depth])


def _colours(surface: Array, end: Array, pixel: float) -> Array:
    """(N, 3) colour of every pixel from where its ray meets the surface plane and where it ends.

    Edges are blended over about a pixel (m) so that they do not show steps.
    """
    half = np.array(POOL, np.float32) / 2
    outside = np.maximum(*(np.abs(surface) - half).T)
    tile = np.maximum(*np.abs((end[:, :2] / np.float32(TILE)) % 1.0 - 0.5).T)
    lane = np.maximum(np.abs(end[:, 1]) - 0.06, np.abs(end[:, 0]) - half[0] + 0.35)
    colour = np.broadcast_to(np.array(FLOOR, np.float32), (len(end), 3))
    colour = _blend(colour, GROUT, (tile - 0.485) * TILE / pixel)
    colour = _blend(colour, LANE, -lane / pixel)
    colour = _blend(colour, WALL, (end[:, 2] + DEPTH) / pixel - 0.5)
    colour *= (1.0 - 0.25 * np.exp(-np.maximum(-outside, 0.0) / 0.10))[
        :, None
    ]  # darker below the rim
    deck = (
        np.array(DECK, np.float32)
        * (0.7 + 0.3 * np.clip((outside - RIM) / 0.06, 0.0, 1.0))[:, None]
    )  # in the rim's shadow
    return _blend(_blend(colour, TOP, outside / pixel), deck, (outside - RIM) / pixel)


def _blend(colour: Array, other: ArrayLike, distance: Array) -> Array:
    """other where distance (pixels beyond an edge) is positive, with one pixel of transition."""
    share = np.clip(distance + 0.5, 0.0, 1.0)[:, None]
    return colour * (1.0 - share) + np.asarray(other, np.float32) * share


@dataclass(frozen=True)
class LightLoop:
    """A loop of coarse grey pictures of moving light. It closes, so any time can be asked."""

    frames: Image  # (frames, h, w)
    period: float  # s

    def at(self, time: float) -> Image:
        """(h, w) light at a time, s, to be enlarged and added to the picture."""
        count = len(self.frames)
        place = (time / self.period) % 1.0 * count
        i, part = int(place) % count, place - int(place)
        now: Image = self.frames[i]
        return cv2.addWeighted(now, 1 - part, self.frames[(i + 1) % count], part, 0)


COARSE = 4  # pixels of the image per coarse pixel
LAMPS = (
    (-1.35, 0.55),
    (0.15, 0.62),
    (1.55, 0.50),
    (-0.60, -0.70),
    (0.95, -0.62),
)  # mirrored lamps, pool frame, m


def moving_light(
    camera: CameraModel, strength: float, seed: int, frames: int = 40, period: float = 4.0
) -> tuple[LightLoop, LightLoop]:
    """Caustics on the floor and glare of lamps mirrored in the surface, strength 0 to 3.

    Ripples are sums of travelling waves whose frequencies are multiples of 1 / period.
    """
    width, height = camera.size
    pixels = np.stack(
        np.meshgrid(np.arange(0, width, COARSE), np.arange(0, height, COARSE)), axis=-1
    )
    place = (
        camera.unproject(pixels.reshape(-1, 2) + (COARSE - 1) / 2)
        .reshape(*pixels.shape)
        .astype(np.float32)
    )
    inside = np.all(np.abs(place) < np.array(POOL, np.float32) / 2, axis=-1)
    lamps: Array = sum(
        np.exp(-((place - np.array(p, np.float32)) ** 2).sum(-1) / (2 * 0.16**2)) for p in LAMPS
    )
    random = np.random.default_rng(seed)
    broad, fine = (_ripples(place, _waves(random, n, k), frames) for n, k in ((7, 16.0), (9, 42.0)))
    caustics = 30.0 * inside * np.exp(-((1.6 * broad) ** 2))
    glare = strength * inside * lamps * (14.0 + 300.0 * np.clip(fine - 0.95, 0.0, 1.0))
    return LightLoop(caustics.astype(np.uint8), period), LightLoop(
        np.clip(glare, 0, 255).astype(np.uint8), period
    )


def _waves(random: np.random.Generator, count: int, wavenumber: float) -> Array:
    """(count, 4) wave vector x, y, rad/m; cycles per loop; phase, rad."""
    angle = random.uniform(0, 2 * np.pi, count)
    k = wavenumber * random.uniform(0.6, 1.4, count)
    cycles = random.integers(2, 6, count) * random.choice([-1, 1], count)
    return np.column_stack(
        [k * np.cos(angle), k * np.sin(angle), cycles, random.uniform(0, 2 * np.pi, count)]
    )


def _ripples(place: Array, waves: Array, frames: int) -> Array:
    """(frames, h, w) surface heights of unit variance at equal parts of the loop, for places (h, w, 2), m.

        sum_i sin(k_i . p + phase_i + 2 pi cycles_i t) = sum_i sin(a_i) cos(b_i) + cos(a_i) sin(b_i)

    a depends on the place only and b on the time only, so that all frames are two matrix products.
    """
    a = place.reshape(-1, 2) @ waves[:, :2].T.astype(np.float32) + waves[:, 3].astype(np.float32)
    b = 2 * np.pi * np.outer(np.arange(frames) / frames, waves[:, 2]).astype(np.float32)
    total = np.cos(b) @ np.sin(a).T + np.sin(b) @ np.cos(a).T
    scaled: Array = total * np.float32(np.sqrt(2.0 / len(waves)))
    return scaled.reshape(frames, *place.shape[:2])
