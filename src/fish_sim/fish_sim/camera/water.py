"""The empty pool from above: still picture, and the light that moves on floor and surface."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_sim.camera.model import CameraModel

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

POOL = (4.27, 2.13)  # m, along pool x and y; MODEL.md
DEPTH = 0.6  # m, of the drawn floor; appearance only
RIM = 0.05  # m, width of the wall's top
TILE = 0.305  # m, floor tiles
REFRACTION = 1.333  # index of water

FLOOR, GROUT, WALL = (196, 172, 96), (172, 148, 78), (168, 140, 70)  # blue, green, red
TOP, DECK, LANE = (205, 205, 200), (112, 116, 118), (150, 112, 42)


def still_pool(camera: CameraModel, seed: int) -> Image:
    """(height, width, 3) picture of the pool at rest: rim, walls, tiled floor seen through the water."""
    width, height = camera.size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    rays = camera.rays(pixels)
    x, y, z = camera.position
    surface = np.array([x, y]) - rays[:, :2] * (z / rays[:, 2])[:, None]
    colour = _colours(surface, _through_water(surface, rays), z / camera.focal[0])
    grain = np.random.default_rng(seed).normal(0.0, 1.0, (height // 8 + 1, width // 8 + 1)).astype(np.float32)
    grain = cv2.resize(grain, (width, height), interpolation=cv2.INTER_CUBIC).reshape(-1, 1)
    picture = (colour + 2.0 * grain).reshape(height, width, 3) * vignette(camera)[..., None]
    return cv2.GaussianBlur(np.clip(picture, 0, 255).astype(np.uint8), (3, 3), 0)


def vignette(camera: CameraModel) -> Array:
    """(height, width) share of light that the lens passes: cos^4 of the angle off axis, softened."""
    width, height = camera.size
    (fx, fy), (cx, cy) = camera.focal, camera.centre
    u, v = (np.arange(width) - cx) / fx, (np.arange(height) - cy) / fy
    return (1.0 + u[None, :] ** 2 + v[:, None] ** 2) ** -0.8


def _through_water(surface: Array, rays: Array) -> Array:
    """(N, 3) points on floor or wall where refracted rays end; Snell: sin(after) = sin(before) / n."""
    flat = np.linalg.norm(rays[:, :2], axis=1)
    sine = flat / np.linalg.norm(rays, axis=1) / REFRACTION
    slope = sine / np.sqrt(1.0 - sine**2)
    sideways = rays[:, :2] / np.maximum(flat, 1e-12)[:, None] * slope[:, None]  # m per m of depth
    half = np.array(POOL) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (np.sign(sideways) * half - surface) / sideways
    depth = np.minimum(DEPTH, np.nanmin(np.where(to_wall >= 0, to_wall, np.inf), axis=1))
    return np.column_stack([surface + sideways * depth[:, None], -depth])


def _colours(surface: Array, end: Array, pixel: float) -> Array:
    """(N, 3) colour of every pixel from where its ray meets the surface plane and where it ends.

    Edges are blended over about a pixel (m) so that they do not show steps.
    """
    half = np.array(POOL) / 2
    outside = np.max(np.abs(surface) - half, axis=1)
    tile = np.abs((end[:, :2] / TILE) % 1.0 - 0.5).max(axis=1)
    lane = np.maximum(np.abs(end[:, 1]) - 0.06, np.abs(end[:, 0]) - half[0] + 0.35)
    colour = np.broadcast_to(np.array(FLOOR, float), (len(end), 3))
    colour = _blend(colour, GROUT, (tile - 0.485) * TILE / pixel)
    colour = _blend(colour, LANE, -lane / pixel)
    colour = _blend(colour, WALL, (end[:, 2] + DEPTH) / pixel - 0.5)
    colour *= (1.0 - 0.25 * np.exp(-np.maximum(-outside, 0.0) / 0.10))[:, None]  # darker below the rim
    deck = (
        np.array(DECK) * (0.7 + 0.3 * np.clip((outside - RIM) / 0.06, 0.0, 1.0))[:, None]
    )  # in the rim's shadow
    return _blend(_blend(colour, TOP, outside / pixel), deck, (outside - RIM) / pixel)


def _blend(colour: Array, other: ArrayLike, distance: Array) -> Array:
    """other where distance (pixels beyond an edge) is positive, with one pixel of transition."""
    share = np.clip(distance + 0.5, 0.0, 1.0)[:, None]
    return colour * (1.0 - share) + np.asarray(other, float) * share


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
        return cv2.addWeighted(self.frames[i], 1 - part, self.frames[(i + 1) % count], part, 0)


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
    pixels = np.stack(np.meshgrid(np.arange(0, width, COARSE), np.arange(0, height, COARSE)), axis=-1)
    place = (
        camera.unproject(pixels.reshape(-1, 2) + (COARSE - 1) / 2).reshape(*pixels.shape).astype(np.float32)
    )
    inside = np.all(np.abs(place) < np.array(POOL, np.float32) / 2, axis=-1)
    lamps = sum(np.exp(-((place - np.array(p, np.float32)) ** 2).sum(-1) / (2 * 0.16**2)) for p in LAMPS)
    random = np.random.default_rng(seed)
    waves = [_waves(random, count, scale) for count, scale in ((7, 16.0), (9, 42.0))]
    loops: tuple[list[Image], list[Image]] = ([], [])
    for i in range(frames):
        broad, fine = (_ripple(place, w, i / frames) for w in waves)
        loops[0].append(np.where(inside, 30.0 * np.exp(-((1.6 * broad) ** 2)), 0.0).astype(np.uint8))
        sparkle = 14.0 * lamps + 300.0 * lamps * np.clip(fine - 0.95, 0.0, 1.0)
        loops[1].append(np.clip(np.where(inside, strength * sparkle, 0.0), 0, 255).astype(np.uint8))
    return LightLoop(np.array(loops[0]), period), LightLoop(np.array(loops[1]), period)


def _waves(random: np.random.Generator, count: int, wavenumber: float) -> Array:
    """(count, 4) wave vector x, y, rad/m; cycles per loop; phase, rad."""
    angle = random.uniform(0, 2 * np.pi, count)
    k = wavenumber * random.uniform(0.6, 1.4, count)
    cycles = random.integers(2, 6, count) * random.choice([-1, 1], count)
    return np.column_stack(
        [k * np.cos(angle), k * np.sin(angle), cycles, random.uniform(0, 2 * np.pi, count)]
    )


def _ripple(place: NDArray[np.float32], waves: Array, part: float) -> NDArray[np.float32]:
    """Surface height of unit variance at a part (0..1) of the loop."""
    total = np.zeros(place.shape[:2], np.float32)
    for kx, ky, cycles, phase in waves.astype(np.float32):
        total += np.sin(kx * place[..., 0] + ky * place[..., 1] + (2 * np.pi * cycles * part + phase))
    return total * np.float32(np.sqrt(2.0 / len(waves)))
