# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Markers to pose: which spots are the head's, where it is and points, how the tail bends, how surely."""

from collections.abc import Sequence
from dataclasses import dataclass
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


def pick_head(
    front: Sequence[Spot], rear: Sequence[Spot], spacing: float, tolerance: float
) -> tuple[Spot, Spot] | None:
    """The pair whose distance fits best, or None if none fits within tolerance (share of spacing)."""
    pairs = [
        (abs(float(np.hypot(*(f.position - r.position))) / spacing - 1.0), i, j)
        for i, f in enumerate(front)
        for j, r in enumerate(rear)
    ]
    if not pairs:
        return None
    error, i, j = min(pairs)
    return (front[i], rear[j]) if error <= tolerance else None


def head_pose(front: Spot, rear: Spot, layout: MarkerLayout) -> HeadPose:
    """Pose of the head from its two markers.

        heading = angle(p_f - p_r) - angle(m_f - m_r),  p = (p_f + p_r) / 2 - R(heading) (m_f + m_r) / 2

    p: markers in the pool, m: in base_link. The covariance follows by the chain rule from those of the two
    spots.
    """
    m_f, m_r = np.array(layout.front), np.array(layout.rear)
    line, mounted = front.position - rear.position, m_f - m_r
    heading = wrap(atan2(line[1], line[0]) - atan2(mounted[1], mounted[0]))
    R = np.array([[cos(heading), -sin(heading)], [sin(heading), cos(heading)]])
    middle = R @ (m_f + m_r) / 2
    x, y = (front.position + rear.position) / 2 - middle
    across = np.array([-line[1], line[0]]) / float(
        line @ line
    )  # d heading / d p_f = - d heading / d p_r
    turn = np.array([middle[1], -middle[0]])  # d p / d heading
    J_f = np.vstack([np.eye(2) / 2 + np.outer(turn, across), across])
    J_r = np.vstack([np.eye(2) / 2 - np.outer(turn, across), -across])
    covariance = J_f @ front.covariance @ J_f.T + J_r @ rear.covariance @ J_r.T
    return HeadPose(float(x), float(y), heading, covariance)


def tail_angles(
    head: HeadPose, spots: Sequence[Sequence[Spot]], layout: MarkerLayout, tolerance: float
) -> tuple[float, ...] | None:
    """Relative angles of the tail's links, from the head backwards, rad, counter-clockwise positive.

        theta_i = angle(h_{i-1} - m_i),  h_i = h_{i-1} - link_length e(theta_i),  result theta_i - theta_{i-1}

    m_i is the spot of link i's colour whose distance from h_{i-1} fits link_length best.

    Args:
        spots: candidates for each link, in order.
        tolerance: greatest misfit of the distance, m.

    Returns:
        One angle per link, or None if a link's marker is missing (a chain with a hole has no angles after
        it).
    """
    hinge = np.array([head.x, head.y]) - layout.hinge_offset * np.array(
        [cos(head.heading), sin(head.heading)]
    )
    before, result = head.heading, []
    for candidates in spots:
        marker = _fitting(hinge, before, candidates, layout.link_length, tolerance)
        if marker is None:
            return None
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


def tail_is_ahead(head: HeadPose, tail: Sequence[Spot], layout: MarkerLayout, reach: float) -> bool:
    """Whether the tail's spots are in front of the head: then front and rear are confused.

    Compares the spots within reach (m) of the tail's hinge with those within reach of its mirror image ahead.
    """
    ahead = layout.hinge_offset * np.array([cos(head.heading), sin(head.heading)])
    centre = np.array([head.x, head.y])
    near = [
        sum(float(np.hypot(*(s.position - end))) < reach for s in tail)
        for end in (centre - ahead, centre + ahead)
    ]
    return near[1] > near[0]
