# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Factors on the variances that follow the innovations.

`total` multiplies all variances of a channel. It grows by GAIN in the logarithm with every innovation that exceeds the
quantile Q of its distribution and shrinks otherwise, so that a share of 1 - Q exceeds it: a quantile, unlike a mean, does
not care how far off an outlier is. `process` multiplies those of the motion in addition: it follows the errors of
predictions over HORIZON, in which the motion weighs more than the camera, until their squares are as large as predicted.
Sources: stochastic quantile estimation (Robbins and Monro 1951); covariance matching (Mehra 1972).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
QUANTILE = 0.7
CHI2 = {1: 1.074, 2: 2.408}  # quantiles by degrees of freedom
GAIN = 0.02  # of total
SMALLEST, LARGEST = 0.25, 400.0  # total
HORIZON = 0.5  # s
EVERY = 5  # poses, one of which is predicted over HORIZON
PROCESS_GAIN = 0.05  # in the end
FIRST_GAINS = (2.0, 0.2)  # 1 / (a + b k) of the k-th prediction, as long as that is larger
FIRST_PROCESS = 1600.0  # cautious: an accelerometer that tilt disturbs is no better than this
LARGEST_PROCESS = 1e4
WILD = 5.0  # squared errors count no more than this many variances
SURPRISE = 2.0  # factor on process for each of many outliers that agree with each other
POSITION, HEADING = slice(0, 2), slice(2, 3)


@dataclass
class Channel:
    """Positions, or headings."""

    total: float = 1.0
    process: float = 1.0
    count: int = 0

    @property
    def motion(self) -> float:
        """On the variances of the motion."""
        return self.total * self.process

    def learn(self, y: Array, S: Array) -> None:
        """An innovation (n,) and its covariance with the present factors."""
        exceeds = float(y @ np.linalg.solve(S, y)) > CHI2[len(y)]
        step = GAIN * (float(exceeds) - (1.0 - QUANTILE))
        self.total = min(max(self.total * math.exp(step), SMALLEST), LARGEST)

    def learn_motion(self, y: Array, S: Array) -> None:
        """The error of a prediction over HORIZON and its covariance."""
        self.count += 1
        gain = max(PROCESS_GAIN, 1.0 / (FIRST_GAINS[0] + FIRST_GAINS[1] * self.count))
        square = float(y @ np.linalg.solve(S, y)) / len(y)
        self.grow(math.exp(gain * (min(square, WILD) - 1.0)))

    def grow(self, factor: float) -> None:
        """Multiply `process`."""
        self.process = min(max(self.process * factor, 1.0), LARGEST_PROCESS)


class NoiseScale:
    """Both channels of a pose (x, y, psi)."""

    def __init__(self, first_process: float = FIRST_PROCESS) -> None:
        self.position, self.heading = Channel(process=first_process), Channel()

    def learn(self, y: Array, S: Array) -> None:
        """The innovation of a pose and its covariance."""
        self.position.learn(y[POSITION], S[POSITION, POSITION])
        self.heading.learn(y[HEADING], S[HEADING, HEADING])

    def learn_motion(self, y: Array, S: Array) -> None:
        """The error of a pose's prediction over HORIZON and its covariance."""
        self.position.learn_motion(y[POSITION], S[POSITION, POSITION])
        self.heading.learn_motion(y[HEADING], S[HEADING, HEADING])

    def surprise(self, y: Array, S: Array) -> None:
        """One of many outliers that agree: the motion is less sure than it seemed."""
        for channel, part in ((self.position, POSITION), (self.heading, HEADING)):
            if float(y[part] @ np.linalg.solve(S[part, part], y[part])) > CHI2[len(y[part])]:
                channel.grow(SURPRISE)
