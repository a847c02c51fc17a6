# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rauch-Tung-Striebel smoother: state and missing wrench given the whole trial."""

from __future__ import annotations

import numpy as np

from fish_sysid.estimation.ekf_types import Array, History


def smooth(history: History) -> tuple[Array, Array]:
    """(xi (T, M, N), standard deviations (T, M, N)) given all measurements (Rauch, Tung and Striebel 1965)."""
    xi, P = history.filtered.copy(), history.filtered_P.copy()
    deviation = np.empty_like(xi)
    deviation[-1] = np.sqrt(np.maximum(np.diagonal(P[-1], axis1=1, axis2=2), 0.0))
    for k in range(len(xi) - 2, -1, -1):
        F, ahead = history.transition[k], history.predicted_P[k + 1]
        # the covariance is close to singular along the constraint: scale before the pseudo-inverse
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(ahead, axis1=1, axis2=2), 1e-18))
        scaled = ahead * scale[:, :, None] * scale[:, None, :]
        inverse = (
            np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
            * scale[:, :, None]
            * scale[:, None, :]
        )
        G = P[k] @ F.transpose(0, 2, 1) @ inverse
        xi[k] += (G @ (xi[k + 1] - history.predicted[k + 1])[..., None])[..., 0]
        P[k] += G @ (P[k + 1] - ahead) @ G.transpose(0, 2, 1)
        deviation[k] = np.sqrt(np.maximum(np.diagonal(P[k], axis1=1, axis2=2), 0.0))
    return xi, deviation
