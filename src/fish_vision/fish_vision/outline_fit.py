# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's pose above a rectangle, fitted to the edges along its sides."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import Array, Lens, project
from fish_vision.segmentation import Image

SAMPLES = 40  # points of each side
REACHES = (
    0.010,
    0.006,
    0.004,
    0.003,
)  # in which an edge is looked for in turn, share of the picture's longer side
STEPS = 3  # of Gauss-Newton in each
BAND = 0.003  # from its side within which an edge belongs to it, share of the picture's longer side
HOPELESS = 0.3  # share of a side with edges below which a pose is given up
CONTRAST, CONTRAST_SHARE = 8.0, 0.4  # grey levels across an edge, and share of its side's, at least
DARK = 6.0  # grey levels that are added before ratios are taken
ALIKE, ROUGHLY = (
    0.35,
    0.9,
)  # share of the mean step by which a side's may differ from it, in the end and before
ACROSS = 3.0  # pixels on both sides of an edge, between which the contrast is measured
FINE = 0.5  # pixels between two places of a profile
SHIFT = 1e-4  # of a parameter, for derivatives


@dataclass(frozen=True)
class OutlineFit:
    """A rectangle as a camera sees it: rotation vector (3,) and translation (3,) of its middle, m.

    points: (N, 2) pixels of the edges on its sides. off: (N,) their distances from the sides, pixels. seen: (4,) share of
    each side with an edge. corners: (4, 2) pixels.
    """

    rotation: Array
    t: Array
    points: Array
    off: Array
    seen: Array
    corners: Array

    @property
    def rms(self) -> float:
        """Of the distances, pixels."""
        return float(np.sqrt(np.mean(self.off**2))) if len(self.off) else np.inf

    @property
    def size(self) -> float:
        """Of the rectangle in the picture, pixels."""
        return float(np.sqrt(cv2.contourArea(self.corners.astype(np.float32))))


class OutlineFitter:
    """Fits rectangles of one size to one picture."""

    def __init__(self, picture: Image, lens: Lens, length: float, width: float) -> None:
        """picture: (h, w, 3). length, width: of the sides, m."""
        self._picture = cv2.GaussianBlur(picture, (0, 0), 1.0).astype(np.float32)
        self._lens, self._longer = lens, float(max(lens.size))
        self.corners = 0.5 * np.array(
            [[length, width, 0], [-length, width, 0], [-length, -width, 0], [length, -width, 0]]
        )
        share = np.linspace(0.02, 0.98, SAMPLES)[:, None]
        ends = np.roll(self.corners, -1, axis=0)
        self._places = np.vstack(
            [a + share * (b - a) for a, b in zip(self.corners, ends, strict=True)]
        )
        outward = (self.corners + ends) / np.linalg.norm(self.corners + ends, axis=1)[:, None]
        self._outward = np.repeat(outward, SAMPLES, axis=0)
        self._side = np.repeat(np.arange(4), SAMPLES)

    def fit(self, R: Array, t: Array) -> OutlineFit | None:
        """The pose near rotation R (3, 3) and translation t (3,) that lays the sides on edges of one thing.

        None where a side shows hardly any edge, or where the colours change otherwise from side to side.

            minimise sum_i rho(n_i . (e_i - p_i)),  e: edge found along the normal n of side point p, rho: Cauchy's loss
        """
        pose = np.append(cv2.Rodrigues(R)[0].ravel(), t)
        for reach in REACHES:
            for _ in range(STEPS):
                at, normal = self._sides(pose)
                off, steps = self._edges(at, normal, reach * self._longer)
                found = np.bincount(self._side[np.isfinite(off)], minlength=4) / SAMPLES
                if found.min() < HOPELESS or not same_step(steps, ROUGHLY):
                    return None
                pose = self._stepped(pose, at, normal, off)
        at, normal = self._sides(pose)
        off, steps = self._edges(at, normal, BAND * self._longer)
        near = np.isfinite(off)
        seen = np.bincount(self._side[near], minlength=4) / SAMPLES
        points = (at + np.nan_to_num(off)[:, None] * normal)[near]
        corners = self._project(self.corners, pose)
        if not same_step(steps, ALIKE):
            return None
        return OutlineFit(pose[:3], pose[3:], points, off[near], seen, corners)

    def _project(self, solid: Array, pose: Array) -> Array:
        return project(solid, pose[:3], pose[3:], self._lens)

    def _sides(self, pose: Array) -> tuple[Array, Array]:
        """(N, 2) points of the sides, pixels, and unit normals that point away from the middle."""
        along = np.column_stack([-self._outward[:, 1], self._outward[:, 0], self._outward[:, 2]])
        at = self._project(self._places, pose)
        tangent = self._project(self._places + SHIFT * along, pose) - at
        out = self._project(self._places + SHIFT * self._outward, pose) - at
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        normal *= np.sign(np.sum(normal * out, axis=1))[:, None]
        return at, normal / np.linalg.norm(normal, axis=1)[:, None]

    def _edges(self, at: Array, normal: Array, reach: float) -> tuple[Array, Array]:
        """(N,) way from each point along its normal to the steepest edge within reach (NaN: none), and (4, 3) logarithms
        of the ratio of each side's colours outside and inside.
        """
        offsets = np.arange(-reach - ACROSS, reach + ACROSS + FINE / 2, FINE)
        where = (at[:, None] + offsets[:, None] * normal[:, None]).astype(np.float32)
        profile = cv2.remap(self._picture, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
        last = np.array(self._lens.size) - 1
        inside = np.all((where >= 0) & (where <= last), axis=(1, 2))
        outer, inner = (offsets > 0) & (offsets <= reach), (offsets < 0) & (offsets >= -reach)
        out, within = profile[:, outer].mean(axis=1), profile[:, inner].mean(axis=1)
        sides = [inside & (self._side == side) for side in range(4)]
        change = np.array([_median((out - within)[side]) for side in sides])
        size = np.linalg.norm(change, axis=1)
        axis = change / np.maximum(size, 1e-9)[:, None]
        level = np.einsum("nkc,nc->nk", profile, axis[self._side])
        least = np.maximum(CONTRAST, CONTRAST_SHARE * size)[self._side]
        off = np.where(inside, _steepest(level, offsets, reach, least), np.nan)
        ratio = np.log((out + DARK) / (within + DARK))
        return off, np.array([_median(ratio[side]) for side in sides])

    def _stepped(self, pose: Array, at: Array, normal: Array, off: Array) -> Array:
        """One step of Gauss-Newton towards the edges."""
        found = np.isfinite(off)
        if found.sum() < SAMPLES:
            return pose
        J = np.empty((len(at), 6))
        for i in range(6):
            moved = self._project(self._places, pose + SHIFT * np.eye(6)[i])
            J[:, i] = np.sum((moved - at) * normal, axis=1) / SHIFT
        residual = off[found]
        scale = max(0.5, 1.5 * float(np.median(np.abs(residual))))
        weight = 1.0 / (1.0 + (residual / scale) ** 2)
        root = np.sqrt(weight)
        step: Array = np.linalg.lstsq(J[found] * root[:, None], residual * root, rcond=None)[0]
        return pose + step


def _median(rows: Array) -> Array:
    """(3,) of rows (N, 3); zero without rows."""
    return np.median(rows, axis=0) if len(rows) else np.zeros(3)


def _steepest(level: Array, offsets: Array, reach: float, least: Array) -> NDArray[Any]:
    """(N,) offset at which each profile (N, K) rises most, between places by a parabola; NaN where by less than `least`."""
    slope = np.gradient(level, FINE, axis=1)
    allowed = np.abs(offsets) <= reach
    slope = np.where(allowed, slope, -np.inf)
    best = np.argmax(slope, axis=1)
    rows, gap = np.arange(len(level)), round(ACROSS / FINE)
    a, b, c = (slope[rows, np.clip(best + i, 0, len(offsets) - 1)] for i in (-1, 0, 1))
    with np.errstate(all="ignore"):
        part = 0.5 * (a - c) / (a - 2.0 * b + c)
    part = np.where(np.isfinite(part), np.clip(part, -0.5, 0.5), 0.0)
    last = len(offsets) - 1
    contrast = level[rows, np.minimum(best + gap, last)] - level[rows, np.maximum(best - gap, 0)]
    found: NDArray[Any] = np.where(contrast > least, offsets[best] + FINE * part, np.nan)
    return found


def same_step(steps: Array, most: float) -> bool:
    """Whether the ratios of colours (4, 3) are alike at all sides, as at the edge of one thing in any light.

    most: share of the mean by which a side's may differ from it.
    """
    mean = steps.mean(axis=0)
    off = np.linalg.norm(steps - mean, axis=1)
    return bool(np.all(off <= most * np.linalg.norm(mean)))
