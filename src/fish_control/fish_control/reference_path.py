# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A path to follow: a dense curve over arc length, with tangent, heading and curvature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


# m, nominal; a tenth of the smallest error that matters (cross-track of a few cm)
SAMPLE_SPACING = 0.005
LONGEST = 200.0  # m; the tables with which so long a path is followed take 1 GB

End = Literal["stop", "loop"]


class PathError(ValueError):
    """A path that cannot be built; the message says what came and what was expected."""


@dataclass(frozen=True)
class ReferencePath:
    """A curve sampled every `spacing` metres of arc length.

        p(s), t(s) = (cos chi, sin chi), n(s) = (-sin chi, cos chi), kappa(s) = d chi / d s

    Frame: pool. Between samples the curve is continued as a parabola from the nearest sample, so values are
    accurate to kappa' ds^3. A closed path is periodic in s; an open one is continued as a straight line
    beyond its ends.

    Attributes:
        points: (M, 2) samples [m]; a closed path does not repeat its first point.
        heading: (M,) course chi of the tangent [rad], unwrapped.
        curvature: (M,) kappa [1/m], positive to the left.
        closed: whether the last point joins the first.
        end: at the end of the path stop, or loop to its beginning (a closed path goes round, an open one
            starts anew).
    """

    name: str
    points: Array
    heading: Array
    curvature: Array
    spacing: float
    closed: bool
    end: End

    @classmethod
    def from_points(
        cls,
        points: ArrayLike,
        *,
        name: str,
        closed: bool = False,
        end: End | None = None,
        spacing: float = SAMPLE_SPACING,
    ) -> ReferencePath:
        """Resample a polyline [m] (at least two distinct points) evenly. `end` defaults to loop if closed,
        else stop.
        """
        vertices = _checked_vertices(points, name, closed)
        if end is not None and end not in get_args(End):
            raise PathError(f"path '{name}': end is {end!r}; known: {', '.join(get_args(End))}")
        samples, step = _resample(vertices, closed, spacing)
        heading = _tangent_heading(samples, closed)
        curvature = _curvature(heading, step, closed)
        return cls(
            name, samples, heading, curvature, step, closed, end or ("loop" if closed else "stop")
        )

    @property
    def length(self) -> float:
        """Arc length [m]; of a closed path one full turn."""
        return self.spacing * (len(self.points) if self.closed else len(self.points) - 1)

    def point(self, s: ArrayLike) -> Array:
        """Position p(s): (...,) arc length [m] -> (..., 2) [m]."""
        k, delta, beyond = self._locate(s)
        chi = self.heading[k]
        parabola = delta[..., None] * _unit(chi) + (0.5 * self.curvature[k] * delta**2)[
            ..., None
        ] * _unit(chi + 0.5 * np.pi)
        return self.points[k] + parabola + beyond[..., None] * self.tangent(s)

    def heading_at(self, s: ArrayLike) -> Array:
        """Course of the tangent chi(s) [rad], not wrapped."""
        k, delta, _ = self._locate(s)
        return self.heading[k] + self.curvature[k] * delta

    def tangent(self, s: ArrayLike) -> Array:
        """Unit tangent t(s): (..., 2)."""
        return _unit(self.heading_at(s))

    def curvature_at(self, s: ArrayLike) -> Array:
        """Curvature kappa(s) [1/m] of the nearest sample, positive to the left; 0 beyond the ends of an open
        path.
        """
        k, _, beyond = self._locate(s)
        return np.where(beyond != 0.0, 0.0, self.curvature[k])

    def _locate(self, s: ArrayLike) -> tuple[NDArray[np.int64], Array, Array]:
        """Nearest sample k, arc length from it [m], and arc length beyond the ends of an open path [m]."""
        s = np.asarray(s, dtype=float)
        on_path = np.mod(s, self.length) if self.closed else np.clip(s, 0.0, self.length)
        k = np.rint(on_path / self.spacing).astype(np.int64)
        beyond = np.zeros_like(s) if self.closed else s - on_path
        return k % len(self.points), on_path - k * self.spacing, beyond


def _unit(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _checked_vertices(points: ArrayLike, name: str, closed: bool) -> Array:
    vertices = np.asarray(points, dtype=float)
    if vertices.ndim != 2 or vertices.shape[1] != 2:
        raise PathError(f"path '{name}': points have shape {vertices.shape}, expected (M, 2)")
    if not np.all(np.isfinite(vertices)):
        raise PathError(
            f"path '{name}': point {np.argwhere(~np.isfinite(vertices))[0][0]} is not finite"
        )
    length = _steps(np.vstack([vertices, vertices[:1]]) if closed else vertices).sum()
    if not length <= LONGEST:
        raise PathError(f"path '{name}': {length:g} m long, expected at most {LONGEST:g} m")
    if closed and len(vertices) > 1 and np.allclose(vertices[0], vertices[-1], atol=1e-9):
        vertices = vertices[:-1]
    vertices = vertices[np.r_[True, _steps(vertices) > 1e-9]]
    if len(vertices) < (3 if closed else 2):
        raise PathError(
            f"path '{name}': {len(vertices)} distinct points; {3 if closed else 2} are needed"
        )
    return vertices


def _steps(vertices: Array) -> Array:
    """Distances [m] from one vertex to the next; infinite where they overflow."""
    with np.errstate(over="ignore"):
        steps: Array = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    return steps


def _resample(vertices: Array, closed: bool, spacing: float) -> tuple[Array, float]:
    """Even samples along the polyline, and their exact distance along it."""
    if closed:
        vertices = np.vstack([vertices, vertices[:1]])
    s = np.r_[0.0, np.cumsum(_steps(vertices))]
    intervals = max(round(s[-1] / spacing), 3)
    s_even = np.linspace(0.0, s[-1], intervals + 1)
    samples = np.column_stack(
        [np.interp(s_even, s, vertices[:, 0]), np.interp(s_even, s, vertices[:, 1])]
    )
    return (samples[:-1] if closed else samples), s[-1] / intervals


def _tangent_heading(samples: Array, closed: bool) -> Array:
    """Direction of the central difference (one-sided at open ends), unwrapped."""
    if closed:
        difference = np.roll(samples, -1, axis=0) - np.roll(samples, 1, axis=0)
    else:
        difference = np.gradient(samples, axis=0)
    return np.unwrap(np.arctan2(difference[:, 1], difference[:, 0]))


def _curvature(heading: Array, spacing: float, closed: bool) -> Array:
    """d chi / d s by central differences."""
    if not closed:
        return np.gradient(heading, spacing)
    ahead, behind = np.roll(heading, -1), np.roll(heading, 1)
    turned: Array = np.angle(np.exp(1j * (ahead - behind)))
    return turned / (2.0 * spacing)


def require_positive(family: str, **values: float) -> None:
    """Raise PathError naming the first value that is not a positive finite number."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise PathError(f"{family}: {name} is {value!r}, expected a positive number")
