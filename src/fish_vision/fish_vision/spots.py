# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From colours in an image to spots in the pool: blobs of a marker's colour and size."""

from collections.abc import Sequence
from math import pi

import numpy as np

from fish_vision.calibration import Calibration
from fish_vision.config import TrackerConfig
from fish_vision.pose import Spot
from fish_vision.segmentation import Blob, Image, find_blobs

CANDIDATES = 6  # blobs of a colour that are considered, largest first


class SpotFinder:
    """Finds the spots of one marker, `front`, `rear`, `tail_odd` or `tail_even`."""

    def __init__(self, config: TrackerConfig, calibration: Calibration) -> None:
        self._config, self._calibration = config, calibration
        _, scale = calibration.place_and_scale(calibration.pool_to_pixel([[0.0, 0.0]]))
        self._pixel = float(
            abs(np.linalg.det(scale[0]))
        )  # m^2 of water that a pixel shows in the middle

    def find(self, hsv: Image, marker: str, origin: tuple[int, int], step: int = 1) -> list[Spot]:
        """Spots of a marker in a part of an image: first pixel at origin, every step-th pixel."""
        config = self._config
        diameter = (
            config.tail_marker_diameter if marker.startswith("tail") else config.marker_diameter
        )
        disc = pi / 4 * diameter**2
        pixel = self._pixel * step**2
        limits = (0.5 * config.area_min * disc / pixel, 2.0 * config.area_max * disc / pixel)
        blobs = find_blobs(hsv, config.colour(marker), limits)[:CANDIDATES]
        return self._of_size(_enlarged(blobs, origin, step), disc)

    def _of_size(self, blobs: Sequence[Blob], disc: float) -> list[Spot]:
        """Blobs as spots, without those whose area does not fit a disc (m^2) at their place.

            std = pixel_std / sqrt(share) + diameter (1 - share) / 3,  share = area / disc area, at most 1

        in pixels; the second term is how far a partly hidden disc's middle moves (half hidden: 0.21).
        """
        if not blobs:
            return []
        places, J = self._calibration.place_and_scale([[b.u, b.v] for b in blobs])
        areas = np.array([b.area for b in blobs])
        shares = areas * np.abs(np.linalg.det(J)) / disc
        whole = np.minimum(shares, 1.0)
        std = self._config.pixel_std / np.sqrt(whole) + np.sqrt(4 / pi * areas) * (1.0 - whole) / 3
        return [
            Spot(places[i], std[i] ** 2 * J[i] @ J[i].T)
            for i in range(len(blobs))
            if self._config.area_min <= shares[i] <= self._config.area_max
        ]


def _enlarged(blobs: Sequence[Blob], origin: tuple[int, int], step: int) -> list[Blob]:
    """Blobs in pixels of the whole image; column i of a thinned image is column i step of the whole one."""
    return [Blob(b.u * step + origin[0], b.v * step + origin[1], b.area * step**2) for b in blobs]
