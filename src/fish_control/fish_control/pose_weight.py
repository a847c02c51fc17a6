# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much a camera pose counts: its message, the noise that the data show, and the camera's clock."""

from __future__ import annotations

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
    return bool(np.any(np.diagonal(covariance) < 0.0))


def given_covariance(covariance: Array | None, config: FusionConfig) -> Array:
    """R (3, 3) of a camera pose: what its message says, or the parameters where a variance is 0 and so says nothing."""
    deviations = [config.camera_position_noise] * 2 + [config.camera_heading_noise]
    given = np.diag(np.square(deviations))
    if covariance is None:
        return given
    R = np.array(covariance, dtype=float)
    silent = np.all(np.isfinite(R)) and np.any(R.diagonal() <= 0.0)
    return given if silent else R


def unusable(stamp: float, camera: CameraPose, covariance: Array | None) -> str:
    """Why a pose with its own covariance (None: not given) is used nowhere, as fusion counts it; "" if it is usable."""
    if covariance is not None and not_measured(covariance):
        return "pose_not_measured"
    R = camera.R
    if not all(np.all(np.isfinite(v)) for v in (stamp, camera.pose, R)):
        return "pose_not_finite"
    tolerance = ROUNDING * float(np.abs(R).max())
    if np.abs(R - R.T).max() > tolerance or np.linalg.eigvalsh(R)[0] < -tolerance:
        return "pose_no_covariance"
    return ""


def weighted(
    camera: CameraPose, scale: NoiseScale, clock: ClockEstimate, motion: Array
) -> CameraPose:
    """The pose with all that makes it uncertain.

    motion: (v_x, v_y, psi') of the fish [m/s, m/s, rad/s], along which a camera's clock that is not known displaces it.
    """
    spread = np.sqrt([scale.position, scale.position, scale.heading])
    R = camera.R * np.outer(spread, spread)
    if not clock.sure:
        R = R + clock.std**2 * np.outer(motion, motion)
    return camera._replace(R=R)
