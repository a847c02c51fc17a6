# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pose and body velocity averaged over strokes: what a prediction and a recording are compared in.

The fish swings with every stroke (0.5 s at 2 Hz). A local straight line through the poses of one second, weighted with a
Hann window, has the swing averaged out: of a 2 Hz motion nothing is left in the value and 6 % in the slope. The same is
done to measured and to predicted poses, so that it favours neither.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALF_WINDOW = 0.5  # s; a Hann window of twice this is as wide as a stroke
LEAST_FRAMES = 0.6  # share of the frames that a window should hold
LARGEST_SHIFT = 0.1  # s, between a window's centre and the mean time of its frames


@dataclass(frozen=True)
class StrokeMean:
    """Weights of poses at F frames for C centres; rows of NaN where the frames do not cover the window."""

    value: Array  # (C, F)
    slope: Array  # (C, F) 1/s

    def __call__(self, pose: Array) -> Array:
        """(C, ..., 6) x, y, psi [m, m, rad] and u, v, r [m/s, m/s, rad/s] of poses (F, ..., 3), psi unwrapped."""
        mean, rate = np.tensordot(self.value, pose, 1), np.tensordot(self.slope, pose, 1)
        cos, sin = np.cos(mean[..., 2]), np.sin(mean[..., 2])
        u = rate[..., 0] * cos + rate[..., 1] * sin
        v = rate[..., 1] * cos - rate[..., 0] * sin
        return np.concatenate([mean, np.stack([u, v, rate[..., 2]], axis=-1)], axis=-1)


def stroke_mean(frames: Array, centres: Array) -> StrokeMean:
    """Weights for frames at times (F,) and centres (C,) [s]: weighted least squares of a line in each window."""
    tau = frames[None, :] - centres[:, None]
    w = np.where(np.abs(tau) < HALF_WINDOW, np.cos(0.5 * np.pi * tau / HALF_WINDOW) ** 2, 0.0)
    period = np.median(np.diff(frames)) if len(frames) > 1 else np.inf
    total = np.maximum(w.sum(1), 1e-12)
    shift = (w * tau).sum(1) / total
    spread = np.maximum((w * (tau - shift[:, None]) ** 2).sum(1), 1e-12)
    slope = w * (tau - shift[:, None]) / spread[:, None]
    value = w / total[:, None] - shift[:, None] * slope
    covered = (w > 0).sum(1) >= max(4.0, LEAST_FRAMES * 2.0 * HALF_WINDOW / period)
    covered &= np.abs(shift) < LARGEST_SHIFT
    return StrokeMean(
        np.where(covered[:, None], value, np.nan), np.where(covered[:, None], slope, np.nan)
    )
