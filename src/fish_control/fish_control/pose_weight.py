# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much a camera pose counts: its message, the noise that the data show, and the camera's clock."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion_config import FusionConfig
from fish_control.measurement_buffer import CameraPose
from fish_control.noise_scale import NoiseScale
from fish_control.offset_sums import ClockEstimate

ROUNDING = 1e-6  # of the largest element of a covariance; trackers compute in single precision
Array = NDArray[np.float64]


def not_measured(covariance: Array) -> bool:
    """Whether a variance of a camera pose's (3, 3) covariance, below 0 such as -1, says that a part is not measured."""
    return any(variance < 0.0 for variance in np.diagonal(covariance).tolist())


def given_covariance(covariance: Array | None, config: FusionConfig) -> Array:
    """R (3, 3) of a camera pose: what its message says, or the parameters where a variance is 0 and so says nothing."""
    if covariance is not None:
        R = np.array(covariance, dtype=float)
        if min(R.diagonal().tolist()) > 0.0 or not np.isfinite(R).all():
            return R
    deviations = [config.camera_position_noise] * 2 + [config.camera_heading_noise]
    return np.diag(np.square(deviations))


def unusable(stamp: float, camera: CameraPose, covariance: Array | None) -> str:
    """Why a pose with its own covariance (None: not given) is used nowhere, as fusion counts it; "" if it is usable."""
    if covariance is not None and not_measured(covariance):
        return "pose_not_measured"
    R = camera.R
    if not (math.isfinite(stamp) and np.isfinite(camera.pose).all() and np.isfinite(R).all()):
        return "pose_not_finite"
    tolerance = ROUNDING * float(np.abs(R).max())
    if np.abs(R - R.T).max() > tolerance or not _is_positive(R + tolerance * np.eye(3)):
        return "pose_no_covariance"
    return ""


def _is_positive(R: Array) -> bool:
    """Whether a symmetric (3, 3) matrix has no eigenvalue below zero, by its leading minors (Sylvester)."""
    (a, b, c), (_, d, e), (_, _, f) = R.tolist()
    minor = a * d - b * b
    return bool(
        a >= 0.0 and minor >= 0.0 and f * minor - a * e * e + 2.0 * b * c * e - c * c * d >= 0.0
    )


def weighted(
    camera: CameraPose, scale: NoiseScale, clock: ClockEstimate, motion: Array
) -> CameraPose:
    """The pose with all that makes it uncertain.

    motion: (v_x, v_y, psi') of the fish [m/s, m/s, rad/s], along which a camera's clock that is not known displaces it.
    """
    spread = np.sqrt([scale.position, scale.position, scale.heading])
    R = camera.R * (spread[:, None] * spread)
    if not clock.sure:
        R = R + clock.std**2 * (motion[:, None] * motion)
    return camera._replace(R=R)
