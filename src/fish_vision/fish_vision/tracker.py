# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker: one image in, one pose out, or the reason why there is none."""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import Calibration
from fish_vision.choice import Choice, Reason
from fish_vision.config import TrackerConfig
from fish_vision.heads import Head, HeadFinder
from fish_vision.pose import HeadPose, link_ends
from fish_vision.segmentation import Box, Image, around, hsv_of
from fish_vision.spots import CASTS, Colours, SpotFinder

Array = NDArray[Any]  # float64

COARSE = 2  # the whole image is searched at every second pixel; what is found there is measured at full resolution
PLACES = 4  # places of the whole image that are measured
LEARN_EVERY = 5  # detections, of which one teaches the light once colours have settled
CAST_AFTER = 10  # images without the fish after which other lights are tried
SAME = 0.05  # m, pairs so near to each other are measured together
HEAD, TAIL = ("front", "rear"), ("tail_odd", "tail_even")


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
    spacing: float | None = (
        None  # misfit of the head markers' distance, of the pair that fits best, share
    )


@dataclass(frozen=True)
class _Seen:
    """What a search of the whole image gives."""

    heads: list[Head]
    boxes: list[Box]  # of each head
    nothing: Reason  # if there is none
    spacing: float | None  # of the pair that fits best


class Tracker:
    """Follows one fish: looks around the last pose first, in the whole image if that fails.

    The whole image is searched once in `look_around_s` anyway, so that other fish are known before the own one is lost.

    The picture gives all heads that its spots may be (HeadFinder); which of them is ours, or that none surely is,
    says Choice.
    """

    def __init__(self, config: TrackerConfig, calibration: Calibration) -> None:
        self._config, self._calibration = config, calibration
        self._spots, self._heads = SpotFinder(config, calibration), HeadFinder(config)
        self._choice = Choice(config)
        self._tails = TAIL if config.tail_links else ()
        self._hsv: Image = np.zeros((0, 0, 3), np.uint8)  # of the box measured last
        self._seen, self._missed = 0, 0  # detections; images without the fish since the last one
        self._looked = -inf  # s, stamp of the image that was last searched as a whole

    @property
    def hue_shifts(self) -> dict[str, float]:
        """By how much the light moved each marker's hues, half degrees."""
        return dict(self._spots.colours.shifts)

    def track(self, image: Image, stamp: float) -> Detection | Lost:
        """Pose in an image (h, w, 3; blue, green, red) of the calibration's size taken at stamp (s)."""
        last = self._choice.last(stamp)
        if last is not None:
            box = self._box(last.x, last.y)
            heads, nothing = self._measure(image, box)
            own = self._choice.near(heads, stamp, nothing)
            if isinstance(own, Head):
                detection = self._detection(own, stamp, box, False)
                if not 0.0 <= stamp - self._looked < self._config.look_around_s:
                    elsewhere = self._everywhere(image, stamp, besides=box)
                    self._choice.others(elsewhere.heads, stamp)
                return detection
        found = self._look_everywhere(image, stamp)
        self._missed = 0 if isinstance(found, Detection) else self._missed + 1
        if (
            last is None
            and self._missed > CAST_AFTER
            and self._tails
            and self._config.hue_shift_max
        ):
            return self._look_in_another_light(image, stamp, found)
        return found

    def _look_in_another_light(
        self, image: Image, stamp: float, found: Detection | Lost
    ) -> Detection | Lost:
        """Try one light; it is believed only where head and whole tail are seen in its colours."""
        colours = self._spots.colours
        self._spots.colours = Colours(self._config, CASTS[self._missed % len(CASTS)])
        other = self._look_everywhere(image, stamp, whole_tail=True)
        if isinstance(other, Detection):
            self._missed = 0
            return other
        self._spots.colours = colours
        return found

    def _look_everywhere(
        self, image: Image, stamp: float, whole_tail: bool = False
    ) -> Detection | Lost:
        """The own head among all of the image."""
        seen = self._everywhere(image, stamp, whole_tail)
        own = self._choice.anywhere(seen.heads, stamp, seen.nothing)
        if isinstance(own, Reason):
            return Lost(stamp, own, seen.spacing)
        return self._detection(
            own, stamp, seen.boxes[[h is own for h in seen.heads].index(True)], True
        )

    def _everywhere(
        self, image: Image, stamp: float, whole_tail: bool = False, besides: Box | None = None
    ) -> "_Seen":
        """Find the heads' markers at low resolution, then measure around them; besides: a box that is left out."""
        self._looked = stamp
        box = (0, 0, image.shape[1], image.shape[0])
        hsv = hsv_of(np.ascontiguousarray(image[::COARSE, ::COARSE]), box)
        front, rear = self._spots.find(hsv, HEAD, (0, 0), COARSE)
        found, spacing = self._heads.pairs(front, rear)
        nothing = _nothing(front, rear)
        places: list[Array] = []
        for i, j in found:
            middle = (front[i].position + rear[j].position) / 2
            if all(np.hypot(*(middle - place)) > SAME for place in places):
                places.append(middle)
        heads: list[Head] = []
        boxes: list[Box] = []
        for place in [p for p in places if besides is None or not self._inside(p, besides)][
            :PLACES
        ]:
            box = self._box(place[0], place[1])
            near, nothing = self._measure(image, box)
            for head in near:
                if whole_tail and len(head.tail) < self._config.tail_links:
                    continue
                if all(
                    np.hypot(head.pose.x - h.pose.x, head.pose.y - h.pose.y) > 1e-3 for h in heads
                ):
                    heads.append(head)
                    boxes.append(box)
        return _Seen(heads, boxes, nothing, spacing)

    def _inside(self, place: Array, box: Box) -> bool:
        u, v = self._calibration.pool_to_pixel(place[None])[0]
        return bool(box[0] <= u < box[2] and box[1] <= v < box[3])

    def _measure(self, image: Image, box: Box) -> tuple[list[Head], Reason]:
        """Heads in a part of the image, and the reason if there is none."""
        if box[0] >= box[2] or box[1] >= box[3]:
            return [], Reason.OUTSIDE
        hsv = self._hsv = hsv_of(image, box)
        front, rear, *tail = self._spots.find(hsv, (*HEAD, *self._tails), box[:2])
        return self._heads.heads(front, rear, tail)[0], _nothing(front, rear)

    def _box(self, x: float, y: float) -> Box:
        r = self._config.roi_radius
        corners = np.array([x, y]) + r * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        return around(self._calibration.pool_to_pixel(corners), self._calibration.lens.size)

    def _detection(self, own: Head, stamp: float, box: Box, whole_image: bool) -> Detection:
        links = self._config.tail_links
        tail = own.tail if links and len(own.tail) == links else None
        self._seen += 1
        due = not self._spots.colours.settled or self._seen % LEARN_EVERY == 0
        if tail is not None and not whole_image and due:
            self._learn(own, box)
        return Detection(stamp, own.pose, tail, own.spacing, box, whole_image)

    def _learn(self, own: Head, box: Box) -> None:
        """Colours of a fish that is ours for certain: head and whole tail are seen."""
        if not self._config.hue_shift_max:
            return
        links = link_ends(own.pose, own.tail, self._heads.layout)
        for marker, place in (
            ("front", own.front.position),
            ("rear", own.rear.position),
            *zip(TAIL, links, strict=False),
        ):
            self._spots.learn(self._hsv, box[:2], marker, place)


def _nothing(front: list[Any], rear: list[Any]) -> Reason:
    """Why spots give no head."""
    return Reason.NO_FRONT if not front else Reason.NO_REAR if not rear else Reason.NO_PAIR
