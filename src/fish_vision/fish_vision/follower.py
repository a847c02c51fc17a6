# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker for the fish's kind of markers."""

from typing import Protocol

from fish_vision.calibration import Calibration
from fish_vision.config import TrackerConfig
from fish_vision.segmentation import Image
from fish_vision.tag_tracker import TagTracker
from fish_vision.tracker import Detection, Lost, Tracker


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
