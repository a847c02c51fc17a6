# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every head that the spots in a picture may be: pairs at the right distance, judged with the tail behind them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.config import TrackerConfig
from fish_vision.pose import HeadPose, MarkerLayout, Spot, head_pose, tail_angles, tail_sides

Array = NDArray[Any]  # float64

MISFIT_MOST = 0.15  # share of the spacing beyond which two spots are no pair, however uncertain
MOST = 12  # pairs that are considered, best first
SIGMAS = 4.0  # standard deviations of the measured distance that a pair may be off
UNCERTAIN_MOST = 0.01  # share of the spacing that they add at most, or a wrong focal length would pass for hidden parts


@dataclass(frozen=True)
class Head:
    """One pair of spots as a head, with what the tail's spots say of it."""

    pose: HeadPose
    front: Spot
    rear: Spot
    spacing: float  # measured distance of the markers over the true one
    misfit: float  # of the distance, standard deviations
    tail: tuple[float, ...]  # angles of the links seen, from the head backwards, rad
    behind: int  # tail spots where the tail is
    ahead: int  # tail spots where it is of a head turned round
    foreign: bool  # a tail whose colours come in another order

    @property
    def swapped(self) -> bool:
        """Whether the tail is ahead: front and rear are mistaken for each other."""
        return self.ahead > self.behind

    def shares_a_marker(self, other: "Head") -> bool:
        """Whether a spot of this head is one of the other's."""
        return self.front is other.front or self.rear is other.rear


def pairs(
    front: Sequence[Spot], rear: Sequence[Spot], layout: MarkerLayout, tolerance: float
) -> tuple[list[tuple[int, int]], float | None]:
    """Pairs (front, rear) whose distance fits, best first, and the distance nearest to the true one (share).

    | |p_f - p_r| / spacing - 1 | <= tolerance + SIGMAS std / spacing, at most MISFIT_MOST
    """
    if not front or not rear:
        return [], None
    f, r = np.array([s.position for s in front]), np.array([s.position for s in rear])
    line = f[:, None] - r
    distance = np.hypot(line[..., 0], line[..., 1])
    shares = distance / layout.spacing - 1.0
    i, j = np.nonzero(np.abs(shares) <= MISFIT_MOST)
    result = []
    for a, b in zip(i.tolist(), j.tolist(), strict=True):
        along = line[a, b] / distance[a, b]
        variance = float(along @ (front[a].covariance + rear[b].covariance) @ along)
        uncertain = min(SIGMAS * variance**0.5 / layout.spacing, UNCERTAIN_MOST)
        if abs(shares[a, b]) <= tolerance + uncertain:
            result.append((abs(float(shares[a, b])), a, b))
    nearest = float(shares.flat[np.argmin(np.abs(shares))])
    return [(a, b) for _, a, b in sorted(result)[:MOST]], nearest


class HeadFinder:
    """Makes heads of spots."""

    def __init__(self, config: TrackerConfig) -> None:
        self._config, self.layout = config, config.layout()
        self._reach = config.tail_links * self.layout.link_length + config.tail_tolerance

    def pairs(
        self, front: Sequence[Spot], rear: Sequence[Spot]
    ) -> tuple[list[tuple[int, int]], float | None]:
        """See `pairs`, with the parameters' tolerance."""
        return pairs(front, rear, self.layout, self._config.spacing_tolerance)

    def heads(
        self, front: Sequence[Spot], rear: Sequence[Spot], tail: Sequence[Sequence[Spot]]
    ) -> tuple[list[Head], float | None]:
        """All heads that the spots may be, and the misfit of the pair that fits best (share).

        Args:
            front: spots of the front marker's colour.
            rear: spots of the rear marker's colour.
            tail: spots of the odd and of the even links' colours; empty without tail markers.
        """
        found, nearest = self.pairs(front, rear)
        return [self._head(front[i], rear[j], tail) for i, j in found], nearest

    def _head(self, front: Spot, rear: Spot, tail: Sequence[Sequence[Spot]]) -> Head:
        config, layout = self._config, self.layout
        pose = head_pose(front, rear, layout)
        line = front.position - rear.position
        distance = hypot(*line)
        along = line / distance
        std = float(along @ (front.covariance + rear.covariance) @ along) ** 0.5
        misfit = (distance - layout.spacing) / (std + config.spacing_tolerance * layout.spacing / 3)
        angles: tuple[float, ...] = ()
        behind = ahead = 0
        foreign = False
        if tail:
            tail = [[s for s in spots if self._apart(s, front, rear)] for spots in tail]
            links = [tail[i % 2] for i in range(config.tail_links)]
            angles = tail_angles(pose, links, layout, config.tail_tolerance)
            every = [spot for spots in tail for spot in spots]
            behind, ahead = tail_sides(pose, every, layout, self._reach)
            if not angles and behind:
                other = [tail[(i + 1) % 2] for i in range(config.tail_links)]
                foreign = len(tail_angles(pose, other, layout, config.tail_tolerance)) > 1
        return Head(
            pose, front, rear, distance / layout.spacing, misfit, angles, behind, ahead, foreign
        )

    def _apart(self, spot: Spot, front: Spot, rear: Spot) -> bool:
        """Whether a spot of a tail colour is no part of the head's markers: their edges show every hue in some light."""
        return all(
            hypot(*(spot.position - other.position)) > self._config.marker_diameter / 2
            for other in (front, rear)
        )
