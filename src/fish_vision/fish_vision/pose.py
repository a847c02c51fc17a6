# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Markers to pose: which spots are the head's, where it is and points, how the tail bends, how surely."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # float64


@dataclass(frozen=True)
class MarkerLayout:
    """Where the markers sit: head markers in base_link axes (x ahead, y left of the centre of mass), m."""

    front: tuple[float, ...]
    rear: tuple[float, ...]
    hinge_offset: float  # head's centre of mass to the tail's hinge, m
    link_length: float  # hinge to the marker at the far end of a link, m

    @property
    def spacing(self) -> float:
        """Distance between the head's markers, m."""
        return float(np.hypot(self.front[0] - self.rear[0], self.front[1] - self.rear[1]))


@dataclass(frozen=True)
class Spot:
    """A blob in the pool: position (2,), m, and its covariance (2, 2), m^2."""

    position: Array
    covariance: Array
    share: float = 1.0  # of a whole marker's area
    moved_std: float = 0.0  # m, by which what hides a part moves the middle, beyond the covariance


@dataclass(frozen=True)
class HeadPose:
    """Head's centre of mass (pool frame, m), heading (rad, counter-clockwise), their covariance (3, 3)."""

    x: float
    y: float
    heading: float
    covariance: Array


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + pi) % (2 * pi) - pi


def head_pose(front: Spot, rear: Spot, layout: MarkerLayout) -> HeadPose:
    """Pose of the head from its two markers, which a rigid body holds at a known distance (see rigid_pose)."""
    mounted = np.array([layout.front, layout.rear], float)
    moved = [
        replace(s, covariance=s.covariance + s.moved_std**2 * np.eye(2)) for s in (front, rear)
    ]
    return rigid_pose(mounted, moved)


def rigid_pose(mounted: Array, seen: Sequence[Spot]) -> HeadPose:
    """Pose of a rigid body from points of it that are seen.

        minimise sum_i (p + R(heading) m_i - z_i)^T Sigma_i^-1 (p + R(heading) m_i - z_i)

    z: points seen in the pool, m: their places on the body, Sigma: covariance of z. Gauss-Newton from the line between
    the first and the last point; the covariance is the inverse of the information. A marker that is partly hidden pulls
    less.

    Args:
        mounted: (N, 2) places in base_link, m, N >= 2; the first and the last differ.
        seen: as many points in the pool.
    """
    m, z = mounted, np.array([spot.position for spot in seen])
    line, along = z[0] - z[-1], m[0] - m[-1]
    heading = atan2(line[1], line[0]) - atan2(along[1], along[0])
    W = [_inverse(spot.covariance) for spot in seen]
    p = z.sum(axis=0) / len(z) - _turned(heading, m.sum(axis=0) / len(m))
    for _ in range(2):
        information, gradient = np.zeros((3, 3)), np.zeros(3)
        for m_i, z_i, W_i in zip(m, z, W, strict=True):
            arm = _turned(heading, m_i)
            J = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
            weighted = J.T @ W_i
            information += weighted @ J
            gradient += weighted @ (z_i - p - arm)
        covariance = np.linalg.inv(information)
        step = covariance @ gradient
        p, heading = p + step[:2], heading + float(step[2])
    return HeadPose(float(p[0]), float(p[1]), wrap(heading), covariance)


def _turned(angle: float, v: Array) -> Array:
    c, s = cos(angle), sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def _inverse(S: Array) -> Array:
    """Of a (2, 2) covariance."""
    (a, b), (c, d) = S.tolist()
    det = a * d - b * c
    return np.array([[d / det, -b / det], [-c / det, a / det]])


def tail_angles(
    head: HeadPose, spots: Sequence[Sequence[Spot]], layout: MarkerLayout, tolerance: float
) -> tuple[float, ...]:
    """Relative angles of the tail's links that are seen, from the head backwards, rad, counter-clockwise positive.

        theta_i = angle(h_{i-1} - m_i),  h_i = h_{i-1} - link_length e(theta_i),  result theta_i - theta_{i-1}

    m_i is the spot of link i's colour whose distance from h_{i-1} fits link_length best.

    Args:
        spots: candidates for each link, in order.
        tolerance: greatest misfit of the distance, m.

    Returns:
        One angle per link up to the first whose marker is missing (a chain with a hole has no angles after it).
    """
    hinge = np.array([head.x, head.y]) - layout.hinge_offset * np.array(
        [cos(head.heading), sin(head.heading)]
    )
    before, result = head.heading, []
    for candidates in spots:
        marker = _fitting(hinge, before, candidates, layout.link_length, tolerance)
        if marker is None:
            break
        theta = atan2(hinge[1] - marker[1], hinge[0] - marker[0])
        result.append(wrap(theta - before))
        hinge = hinge - layout.link_length * np.array([cos(theta), sin(theta)])
        before = theta
    return tuple(result)


def _fitting(
    hinge: Array, before: float, candidates: Sequence[Spot], length: float, tolerance: float
) -> Array | None:
    """Position of the spot that lies one link behind the hinge, bent by less than a right angle."""
    behind = -np.array([cos(before), sin(before)])
    fits = [
        (abs(float(np.hypot(*(s.position - hinge))) - length), i)
        for i, s in enumerate(candidates)
        if float((s.position - hinge) @ behind) > 0.0
    ]
    if not fits or min(fits)[0] > tolerance:
        return None
    return candidates[min(fits)[1]].position


def tail_sides(
    head: HeadPose, tail: Sequence[Spot], layout: MarkerLayout, reach: float
) -> tuple[int, int]:
    """How many of the tail's spots lie where the tail is, and ahead, where it would be of a head turned round.

    Counts the spots within reach (m) of the tail's hinge and of its mirror image ahead.
    """
    ahead = layout.hinge_offset * np.array([cos(head.heading), sin(head.heading)])
    centre = np.array([head.x, head.y])
    behind, before = (
        sum(float(np.hypot(*(s.position - end))) < reach for s in tail)
        for end in (centre - ahead, centre + ahead)
    )
    return behind, before


def link_ends(pose: HeadPose, tail: Sequence[float], layout: MarkerLayout) -> list[Array]:
    """Far ends (2,) of the tail's links in the pool, m, where their markers sit."""
    angle = pose.heading
    place = np.array([pose.x, pose.y]) - layout.hinge_offset * np.array([cos(angle), sin(angle)])
    result = []
    for relative in tail:
        angle += relative
        place = place - layout.link_length * np.array([cos(angle), sin(angle)])
        result.append(place)
    return result
