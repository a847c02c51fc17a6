# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker: one image in, one pose out, or the reason why there is none."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import POOL, Calibration
from fish_vision.config import TrackerConfig
from fish_vision.pose import HeadPose, Spot, head_pose, pick_head, tail_angles, tail_is_ahead, wrap
from fish_vision.segmentation import Box, Image, around, hsv_of
from fish_vision.spots import SpotFinder

Array = NDArray[Any]  # float64

COARSE = 2  # the whole image is searched at every second pixel; what is found there is measured at full resolution
JUMP_DISTANCE = 0.03  # m, never counted as a jump
JUMP_TURN = 0.3  # rad, never counted as a jump


class Reason(Enum):
    """Why an image gave no pose."""

    NO_FRONT = "no front marker"
    NO_REAR = "no rear marker"
    NO_PAIR = "front and rear marker not the right distance apart"
    SWAPPED = "tail markers ahead of the head: markers or colours swapped"
    OUTSIDE = "pose outside the pool"
    JUMP = "jump: too far from the last pose"


@dataclass(frozen=True)
class Detection:
    """Where the fish was at a stamp."""

    stamp: float  # s, of the image
    head: HeadPose
    tail: tuple[float, ...] | None  # relative angles, rad; None if a tail marker was not seen
    spacing: float  # measured distance of the head's markers over the true one
    box: Box  # part of the image that was measured
    whole_image: bool  # found by searching the whole image


@dataclass(frozen=True)
class Lost:
    """No pose at a stamp."""

    stamp: float  # s, of the image
    reason: Reason


class Tracker:
    """Follows one fish: looks around the last pose first, in the whole image if that fails.

    A pose is believed if the head's two colours are the right distance apart, the tail is behind, the place
    is in the pool, and it can be reached from the last pose. After `reacquire_s` without a believed pose the
    last one is forgotten.
    """

    def __init__(self, config: TrackerConfig, calibration: Calibration) -> None:
        self._config, self._calibration = config, calibration
        self._layout = config.layout()
        self._finder = SpotFinder(config, calibration)
        self._last: Detection | None = None

    def track(self, image: Image, stamp: float) -> Detection | Lost:
        """Pose in an image (h, w, 3; blue, green, red) of the calibration's size taken at stamp (s)."""
        if (
            self._last is not None
            and not 0.0 <= stamp - self._last.stamp <= self._config.reacquire_s
        ):
            self._last = None
        found = (
            Lost(stamp, Reason.NO_FRONT)
            if self._last is None
            else self._look_near_last(image, stamp)
        )
        if isinstance(found, Lost):
            found = self._look_everywhere(image, stamp)
        if isinstance(found, Detection):
            self._last = found
        return found

    def _look_near_last(self, image: Image, stamp: float) -> Detection | Lost:
        assert self._last is not None
        return self._measure(image, stamp, self._last.head.x, self._last.head.y, False)

    def _look_everywhere(self, image: Image, stamp: float) -> Detection | Lost:
        """Find the head's markers at low resolution, then measure around them."""
        box = (0, 0, image.shape[1], image.shape[0])
        hsv = hsv_of(np.ascontiguousarray(image[::COARSE, ::COARSE]), box)
        head = self._pick(*(self._finder.find(hsv, m, (0, 0), COARSE) for m in ("front", "rear")))
        if isinstance(head, Reason):
            return Lost(stamp, head)
        middle = (head[0].position + head[1].position) / 2
        return self._measure(image, stamp, middle[0], middle[1], True)

    def _measure(
        self, image: Image, stamp: float, x: float, y: float, whole_image: bool
    ) -> Detection | Lost:
        """Pose from the part of the image within roi_radius of a place in the pool."""
        box = self._box(x, y)
        if box[0] >= box[2] or box[1] >= box[3]:
            return Lost(stamp, Reason.OUTSIDE)
        hsv = hsv_of(image, box)
        pair = self._pick(*(self._finder.find(hsv, m, box[:2]) for m in ("front", "rear")))
        if isinstance(pair, Reason):
            return Lost(stamp, pair)
        head = head_pose(*pair, self._layout)
        tail = (
            [self._finder.find(hsv, m, box[:2]) for m in ("tail_odd", "tail_even")]
            if self._config.tail_links
            else []
        )
        refused = self._refuse(head, [spot for spots in tail for spot in spots], stamp)
        if refused is not None:
            return Lost(stamp, refused)
        spacing = float(np.hypot(*(pair[0].position - pair[1].position))) / self._layout.spacing
        return Detection(stamp, head, self._tail(head, tail), spacing, box, whole_image)

    def _box(self, x: float, y: float) -> Box:
        r = self._config.roi_radius
        corners = np.array([x, y]) + r * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        return around(self._calibration.pool_to_pixel(corners), self._calibration.lens.size)

    def _pick(self, front: Sequence[Spot], rear: Sequence[Spot]) -> tuple[Spot, Spot] | Reason:
        if not front:
            return Reason.NO_FRONT
        if not rear:
            return Reason.NO_REAR
        pair = pick_head(front, rear, self._layout.spacing, self._config.spacing_tolerance)
        return Reason.NO_PAIR if pair is None else pair

    def _tail(self, head: HeadPose, tail: Sequence[Sequence[Spot]]) -> tuple[float, ...] | None:
        links = [tail[i % 2] for i in range(self._config.tail_links)]
        return (
            tail_angles(head, links, self._layout, self._config.tail_tolerance) if links else None
        )

    def _refuse(self, head: HeadPose, tail: Sequence[Spot], stamp: float) -> Reason | None:
        """Why a pose is not believed, or None."""
        margin = self._config.pool_margin
        if abs(head.x) > POOL[0] / 2 + margin or abs(head.y) > POOL[1] / 2 + margin:
            return Reason.OUTSIDE
        reach = self._config.tail_links * self._layout.link_length + self._config.tail_tolerance
        if tail_is_ahead(head, tail, self._layout, reach):
            return Reason.SWAPPED
        if self._last is None:
            return None
        dt, last = stamp - self._last.stamp, self._last.head
        far = (
            np.hypot(head.x - last.x, head.y - last.y) > self._config.max_speed * dt + JUMP_DISTANCE
        )
        turned = abs(wrap(head.heading - last.heading)) > self._config.max_yaw_rate * dt + JUMP_TURN
        return Reason.JUMP if far or turned else None
