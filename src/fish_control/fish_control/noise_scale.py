# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Factors on all variances, of poses and of motion, that follow the innovations.

A factor grows by GAIN in the logarithm with every innovation that exceeds the quantile Q of its distribution and shrinks
otherwise, so that a share of 1 - Q exceeds it: a quantile, unlike a mean, does not care how far off an outlier is. How the
motion's variances relate to those of the poses is chosen in `motion_models`. Source: stochastic quantile estimation
(Robbins and Monro 1951).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
QUANTILE = 0.7
CHI2 = {1: 1.074, 2: 2.408}  # quantiles by degrees of freedom
GAIN = 0.02
SMALLEST, LARGEST = 0.25, 400.0
POSITION, HEADING = slice(0, 2), slice(2, 3)


class NoiseScale:
    """Both factors; 1 at first.

    Attributes:
        position, heading: on the variances of positions and headings.
    """

    def __init__(self) -> None:
        self.position = self.heading = 1.0

    def learn(self, y: Array, S: Array) -> None:
        """The innovation of a pose (x, y, psi) and its covariance with the present factors."""
        self.position = _follow(self.position, y[POSITION], S[POSITION, POSITION])
        self.heading = _follow(self.heading, y[HEADING], S[HEADING, HEADING])


def _follow(factor: float, y: Array, S: Array) -> float:
    step = GAIN * (float(_square(y.tolist(), S.tolist()) > CHI2[len(y)]) - (1.0 - QUANTILE))
    return min(max(factor * math.exp(step), SMALLEST), LARGEST)


def _square(y: list[float], S: list[list[float]]) -> float:
    """y S^-1 y of one or two numbers, by the cofactors of S."""
    if len(y) == 1:
        return y[0] * y[0] / S[0][0]
    (first, second), ((a, b), (_, c)) = y, S
    return (c * first * first - 2.0 * b * first * second + a * second * second) / (a * c - b * b)
