# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker for the fish's kind of markers: coded tags here, coloured markers in `tracker`."""

from dataclasses import dataclass
from math import cos, sin
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import Calibration
from fish_vision.choice import Reason, in_pool, reaches
from fish_vision.config import TrackerConfig
from fish_vision.heads import Track
from fish_vision.pose import HeadPose, Spot, rigid_pose, wrap
from fish_vision.segmentation import Box, Image, around
from fish_vision.tags import Tag, TagDetector
from fish_vision.tracker import Detection, Lost, Tracker

Array = NDArray[Any]  # float64


@dataclass(frozen=True)
class Seen:
    """The tags of our fish in a part of the picture."""

    pose: HeadPose
    size: float  # mean side of the head's tag over the true one
    tail: tuple[float, ...] | None  # relative angles, rad


class TagTracker:
    """Follows one fish by the numbers of its tags: around the last pose first, in the whole image if that fails.

    The number says which fish it is. Two tags of the head's number, one of another size, or a jump give no pose.
    """

    def __init__(self, config: TrackerConfig, calibration: Calibration) -> None:
        self._config, self._calibration = config, calibration
        self._detector = TagDetector(config.tag_dictionary)
        self._head = _mounted(config.tag_size, *config.head_tag_pose)
        self._numbers = [config.first_tail_tag + i for i in range(config.tail_links)]
        _, scale = calibration.place_and_scale(calibration.pool_to_pixel([[0.0, 0.0]]))
        smallest = min(config.tag_size, config.tail_tag_size if self._numbers else np.inf)
        self._side = smallest / float(np.sqrt(abs(np.linalg.det(scale[0]))))  # pixels
        self._own: Track | None = None

    @property
    def hue_shifts(self) -> dict[str, float]:
        """None: tags are black and white."""
        return {}

    def track(self, image: Image, stamp: float) -> Detection | Lost:
        """Pose in an image (h, w, 3; blue, green, red) of the calibration's size taken at stamp (s)."""
        if self._own is not None and stamp < self._own.stamp:
            self._own = None
        if self._own is not None and stamp - self._own.stamp <= self._config.reacquire_s:
            box = self._box(self._own.pose)
            found = self._look(image, box)
            if isinstance(found, Seen) and self._continues(found, stamp):
                return self._detection(found, stamp, box, whole_image=False)
        whole = (0, 0, image.shape[1], image.shape[0])
        found = self._look(image, whole)
        if not isinstance(found, Seen):
            return Lost(stamp, *found)
        if not self._continues(found, stamp):
            return Lost(stamp, Reason.JUMP)
        return self._detection(found, stamp, self._box(found.pose), whole_image=True)

    def _look(self, image: Image, box: Box) -> Seen | tuple[Reason, float | None]:
        """Our fish in a part of the image, or the reason why it is not seen, and the misfit of its tag's size."""
        left, top, right, bottom = box
        tags = self._detector.find(image[top:bottom, left:right], self._side)
        tags = [Tag(tag.number, tag.corners + np.array([left, top])) for tag in tags]
        heads = [tag for tag in tags if tag.number == self._config.head_tag]
        if not heads:
            return Reason.NO_TAG, None
        if len(heads) > 1:
            return Reason.AMBIGUOUS, None
        pose, size = self._pose(heads[0])
        if abs(size - 1.0) > self._config.spacing_tolerance:
            return Reason.TAG_SIZE, size - 1.0
        if not in_pool(pose, self._config.pool_margin):
            return Reason.OUTSIDE, None
        return Seen(pose, size, self._tail(pose, tags))

    def _pose(self, tag: Tag) -> tuple[HeadPose, float]:
        """Pose of the head and the tag's mean side over the true one."""
        places, J = self._calibration.place_and_scale(tag.corners)
        variance = self._config.corner_std**2
        spots = [Spot(z, variance * j @ j.T) for z, j in zip(places, J, strict=True)]
        return rigid_pose(self._head, spots), _side(places) / self._config.tag_size

    def _tail(self, pose: HeadPose, tags: list[Tag]) -> tuple[float, ...] | None:
        """Angle of each link's tag to the one before it, rad; None where a tag is missing or another fish's."""
        before, angles = pose.heading, []
        for i, number in enumerate(self._numbers):
            reach = self._config.hinge_offset + (i + 1) * self._config.link_length
            places = [
                self._calibration.pixel_to_pool(t.corners) for t in tags if t.number == number
            ]
            near = [p for p in places if np.hypot(*(p.mean(axis=0) - [pose.x, pose.y])) <= reach]
            if len(near) != 1:
                return None
            ahead = near[0][1] + near[0][2] - near[0][0] - near[0][3]
            heading = float(np.arctan2(ahead[1], ahead[0]))
            angles.append(wrap(heading - before))
            before = heading
        return tuple(angles) if angles else None

    def _continues(self, found: Seen, stamp: float) -> bool:
        return self._own is None or reaches(self._own, found.pose, stamp, self._config)

    def _box(self, pose: HeadPose) -> Box:
        r = self._config.roi_radius
        corners = np.array([pose.x, pose.y]) + r * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        return around(self._calibration.pool_to_pixel(corners), self._calibration.lens.size)

    def _detection(self, found: Seen, stamp: float, box: Box, whole_image: bool) -> Detection:
        self._own = Track(found.pose, stamp)
        return Detection(stamp, found.pose, found.tail, found.size, box, whole_image)


def _mounted(size: float, x: float, y: float, yaw: float) -> Array:
    """(4, 2) corners of a tag in base_link, m, in the order of Tag; its x axis is its picture's right."""
    h = size / 2
    corners = np.array([[-h, h], [h, h], [h, -h], [-h, -h]])
    R = np.array([[cos(yaw), -sin(yaw)], [sin(yaw), cos(yaw)]])
    placed: Array = corners @ R.T + np.array([x, y])
    return placed


def _side(corners: Array) -> float:
    """Mean length of the sides of a tag with corners (4, 2)."""
    return float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).mean())


class Follower(Protocol):
    """What follows one fish from image to image."""

    @property
    def hue_shifts(self) -> dict[str, float]:
        """By how much the light moved each coloured marker's hues, half degrees."""

    def track(self, image: Image, stamp: float) -> Detection | Lost:
        """Pose in an image taken at stamp (s), or why there is none."""


def make_follower(config: TrackerConfig, calibration: Calibration) -> Follower:
    """Tracker of coloured markers or of coded tags, as `marker_kind` says."""
    kind = TagTracker if config.marker_kind == "tags" else Tracker
    return kind(config, calibration)
