# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The picture that the overhead camera takes of the pool with the fish in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fish_sim.camera.fish import FishPose, FishShape, Patch, patches, silhouette
from fish_sim.camera.model import CameraModel
from fish_sim.camera.water import DEPTH, moving_light, still_pool, vignette

Array = NDArray[Any]  # float64
Image = NDArray[Any]  # uint8, (h, w, 3) or (h, w)

FINE = 4  # subpixels per pixel and direction when the fish is drawn
SHIFT = 4  # fractional bits of polygon corners
SHADOW = 0.30  # share of light that the fish takes from the floor below it
MARGIN = 4  # pixels around the fish's patch


@dataclass(frozen=True)
class Look:
    """What the sensor and the compression do to the picture."""

    noise_std: float = 3.0  # grey levels
    glare: float = 1.0  # strength of lamp reflections
    jpeg_quality: int = 90
    seed: int = 1


class PoolRenderer:
    """Draws frames: still background + caustics, shadow, fish, glare, noise.

    Everything that does not depend on the fish is made once; a frame costs a few full-image additions and a
    small patch drawn at FINE x FINE subpixels. The noise is one tile shown at random offsets. Seeded: the
    same calls in the same order give the same pictures.
    """

    def __init__(self, camera: CameraModel, shape: FishShape, look: Look) -> None:
        self.camera = camera
        self._shape, self._look = shape, look
        self._pool = still_pool(camera, look.seed)
        self._light_share = vignette(camera)
        self._caustics, self._glare = moving_light(camera, look.glare, look.seed)
        self._random = np.random.default_rng(look.seed)
        self._noise = _noise_tile(camera.size, look.noise_std, self._random)
        # kept between frames: fresh megabytes cost more in page faults than the sums made in them
        self._picture, self._light = np.empty_like(self._pool), np.empty_like(self._pool)
        self._grey = np.empty(self._pool.shape[:2], np.uint8)

    def render(
        self,
        poses: Sequence[FishPose],
        time: float,
        below: Sequence[Sequence[Patch]] = (),
        above: Sequence[Sequence[Patch]] = (),
    ) -> Image:
        """(height, width, 3) picture, blue green red.

        Args:
            poses: the fish at equal parts of the exposure (one pose = no motion blur, none = empty pool).
            time: s, moves the light on the water.
            below: other things in the water, drawn under the fish: another fish, a toy.
            above: things over the fish, such as a bar that hides part of it.
        """
        picture = self._picture
        self._add_light(self._pool, self._caustics.at(time), picture)
        self.draw(picture, poses, below, above)
        self._add_light(picture, self._glare.at(time), picture)
        return self._with_noise(picture)

    def draw(
        self,
        picture: Image,
        poses: Sequence[FishPose],
        below: Sequence[Sequence[Patch]] = (),
        above: Sequence[Sequence[Patch]] = (),
    ) -> None:
        """Draw the fish and other things into a picture of this camera, without glare and noise."""
        for thing in below:
            self._draw_thing(picture, thing)
        if poses:
            self._draw_fish(picture, poses)
        for thing in above:
            self._draw_thing(picture, thing)

    def _add_light(self, picture: Image, coarse: Image, result: Image) -> None:
        cv2.resize(coarse, self.camera.size, dst=self._grey)
        cv2.cvtColor(self._grey, cv2.COLOR_GRAY2BGR, dst=self._light)
        cv2.add(picture, self._light, dst=result)

    def jpeg(self, picture: Image) -> bytes:
        """The picture as JPEG with 4:2:2 colour, as webcams send it; OpenCV before 4.7 only has 4:2:0."""
        options = [cv2.IMWRITE_JPEG_QUALITY, self._look.jpeg_quality]
        if hasattr(cv2, "IMWRITE_JPEG_SAMPLING_FACTOR"):
            options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422]
        return cv2.imencode(".jpg", picture, options)[1].tobytes()

    def _draw_fish(self, picture: Image, poses: Sequence[FishPose]) -> None:
        """Shadow, then the mean of all poses, into the patch of the picture that holds them."""
        fishes = [patches(pose, self._shape) for pose in poses]
        outlines = [patch.outline for fish in fishes for patch in fish]
        cast = silhouette(poses[len(poses) // 2], self._shape)
        seen = self._pixels([*outlines, *cast], [0.0] * len(outlines) + [-DEPTH] * len(cast))
        box = _box(np.vstack(seen), self.camera.size)
        if box is None:
            return
        corners = _subpixels(seen, box)
        shadows, drawn = corners[len(outlines) :], iter(corners)
        shapes = [[(next(drawn), patch.colour) for patch in fish] for fish in fishes]
        left, top, right, bottom = box
        view = picture[top:bottom, left:right].astype(np.float32)
        view *= 1.0 - SHADOW * _shade(shadows, box)[..., None]
        colour, cover = np.zeros_like(view), np.zeros(view.shape[:2], np.float32)
        for fish in shapes:
            one_colour, one_cover = _fill(fish, box)
            colour += one_colour / len(shapes)
            cover += one_cover / len(shapes)
        self._lay(picture, view, colour, cover, box)

    def _draw_thing(self, picture: Image, thing: Sequence[Patch]) -> None:
        """The patches of one thing at rest, without a shadow."""
        seen = self._pixels([patch.outline for patch in thing], [0.0] * len(thing))
        box = _box(np.vstack(seen), self.camera.size)
        if box is not None:
            colours = [patch.colour for patch in thing]
            outlines = list(zip(_subpixels(seen, box), colours, strict=True))
            view = picture[box[1] : box[3], box[0] : box[2]].astype(np.float32)
            self._lay(picture, view, *_fill(outlines, box), box)

    def _lay(
        self,
        picture: Image,
        view: Array,
        colour: Array,
        cover: Array,
        box: tuple[int, int, int, int],
    ) -> None:
        """Put colour (h, w, 3), weighted with its cover (h, w), over a view of the picture in a box."""
        left, top, right, bottom = box
        light = self._light_share[top:bottom, left:right, None]
        view = view * (1.0 - cover[..., None]) + colour * light
        picture[top:bottom, left:right] = np.clip(view + 0.5, 0, 255).astype(np.uint8)

    def _pixels(self, outlines: Sequence[Array], heights: Sequence[float]) -> list[Array]:
        """(N, 2) corners of each outline, m, at its height, m, as pixels; one projection for all of them."""
        flat = np.vstack(outlines)
        height = np.repeat(heights, [len(outline) for outline in outlines])
        return _split(self.camera.project(np.column_stack([flat, height])), outlines)

    def _with_noise(self, picture: Image) -> Image:
        rows, columns = (
            self._noise[0].shape[0] - picture.shape[0],
            self._noise[0].shape[1] - picture.shape[1],
        )
        i, j = self._random.integers(0, rows + 1), self._random.integers(0, columns + 1)
        place = np.s_[i : i + picture.shape[0], j : j + picture.shape[1]]
        brighter, darker = self._noise
        noisy = cv2.add(picture, brighter[place])
        return cv2.subtract(noisy, darker[place], dst=noisy)


def _noise_tile(
    size: tuple[int, int], std: float, random: np.random.Generator
) -> tuple[Image, Image]:
    """What makes pixels brighter and what makes them darker, larger than the image for random offsets.

    Each pixel has one of the two: added and subtracted with saturation, they are the noise clipped once.
    """
    noise = np.round(random.normal(0.0, std, (size[1] + 61, size[0] + 127, 3)))
    brighter, darker = np.clip(noise, 0, 255), np.clip(-noise, 0, 255)
    return brighter.astype(np.uint8), darker.astype(np.uint8)


def _box(corners: Array, size: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """left, top, right, bottom of the patch inside the image, or None if nothing of it is inside."""
    low = np.floor(corners.min(axis=0)).astype(int) - MARGIN
    high = np.ceil(corners.max(axis=0)).astype(int) + MARGIN + 1
    left, top = max(low[0], 0), max(low[1], 0)
    right, bottom = min(high[0], size[0]), min(high[1], size[1])
    return (left, top, right, bottom) if left < right and top < bottom else None


def _split(rows: Array, like: Sequence[Array]) -> list[Array]:
    """Rows as parts that are as long as those of `like`."""
    ends = np.cumsum([len(part) for part in like])
    return [rows[end - len(part) : end] for part, end in zip(like, ends, strict=True)]


def _subpixels(outlines: Sequence[Array], box: tuple[int, int, int, int]) -> list[Array]:
    """Fixed-point corners in the enlarged patch; subpixel centres: (u - left + 1/2) FINE - 1/2."""
    place: Array = (np.vstack(outlines) - np.array(box[:2]) + 0.5) * FINE - 0.5
    return _split(np.round(place * (1 << SHIFT)).astype(np.int32), outlines)


def _shrink(canvas: Image, box: tuple[int, int, int, int]) -> Image:
    return cv2.resize(canvas, (box[2] - box[0], box[3] - box[1]), interpolation=cv2.INTER_AREA)


def _canvas(box: tuple[int, int, int, int], *channels: int) -> Image:
    return np.zeros(((box[3] - box[1]) * FINE, (box[2] - box[0]) * FINE, *channels), np.uint8)


def _fill(
    fish: Sequence[tuple[Array, tuple[int, int, int]]], box: tuple[int, int, int, int]
) -> tuple[Array, Array]:
    """Colour times cover (h, w, 3) and cover (h, w) of the fish, of corners in subpixels, in the patch, antialiased."""
    colour, cover = _canvas(box, 3), _canvas(box)
    for corners, fill in fish:
        cv2.fillPoly(colour, [corners], fill, shift=SHIFT)
        cv2.fillPoly(cover, [corners], 255, shift=SHIFT)
    return _shrink(colour, box).astype(np.float32), _shrink(cover, box).astype(np.float32) / 255.0


def _shade(outlines: Sequence[Array], box: tuple[int, int, int, int]) -> Array:
    """(h, w) cover of the shadow of outlines, in subpixels, softened by the depth of the water."""
    cover = _canvas(box)
    for corners in outlines:
        cv2.fillPoly(cover, [corners], 255, shift=SHIFT)
    return cv2.GaussianBlur(_shrink(cover, box).astype(np.float32) / 255.0, (9, 9), 2.5)
