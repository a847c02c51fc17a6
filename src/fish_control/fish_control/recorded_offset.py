# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's offset to the IMU's clock from a whole recording, with its standard deviation.

The sums of squares are those of `camera_clock`, of blocks of BLOCK each. All blocks together give the estimate; leaving out
one at a time gives its standard deviation, which knows what the single poses do not: errors that last. Sources:
`camera_clock`; jackknife over blocks (Kunsch 1989). The estimates of several recordings are pooled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fish_control.camera_clock import AHEAD, LONGEST_PAIR, OLDEST
from fish_control.offset_sums import CLIP, LAG, STEP, ClockEstimate, OffsetSums

Array = NDArray[np.float64]
BLOCK = 5.0  # s


@dataclass(frozen=True)
class RecordedOffset:
    """What a recording says."""

    estimate: ClockEstimate
    age: float  # s, median age of an image when its pose arrives, by the newest IMU stamp
    pairs: int  # of poses that were compared
    blocks: tuple[ClockEstimate, ...]  # one for each BLOCK, near the estimate


def recorded_offset(
    camera: Array, headings: Array, latencies: Array, imu: Array, yaw: Array
) -> RecordedOffset:
    """The offset that is added to the camera's stamps.

    Args:
        camera: stamps of the poses (N,) [s], increasing.
        headings: of the poses (N,) [rad].
        latencies: from stamp to arrival (N,) [s], as the IMU's clock shows the arrival.
        imu: stamps of the IMU's samples (M,) [s], increasing.
        yaw: the IMU's continuous heading (M,) [rad].

    Raises:
        ValueError: too few poses or samples overlap.
    """
    latency = float(np.median(latencies)) if len(latencies) else math.nan
    begin = math.floor((latency - OLDEST) / STEP) * STEP if len(latencies) else 0.0
    grid = begin + STEP * np.arange(round((OLDEST + AHEAD) / STEP) + 1, dtype=np.float64)
    later, earlier = _pairs(camera)
    if len(imu) > 1:
        inside = (camera[earlier] + grid[0] >= imu[0]) & (camera[later] + grid[-1] <= imu[-1])
        later, earlier = later[inside], earlier[inside]
    if len(imu) < 2 or len(later) == 0:
        raise ValueError(
            f"{len(camera)} camera poses and {len(imu)} IMU samples do not overlap: expected both sensors at the same time"
        )
    squares = _squares(camera, headings, imu, yaw, grid, later, earlier)
    block = ((camera[later] - camera[later[0]]) // BLOCK).astype(int)
    total = _sums(squares)
    found = total.estimate(grid)
    near = [_sums(squares[block == k]).estimate(grid, found.offset) for k in np.unique(block)]
    left_out = [
        _sums(squares[block != k]).estimate(grid, found.offset).offset for k in np.unique(block)
    ]
    std = math.hypot(found.std, _jackknife(np.array(left_out)))
    estimate = ClockEstimate(found.offset, std, found.sure)
    blocks = tuple(e for e in near if math.isfinite(e.std))
    return RecordedOffset(estimate, latency - found.offset, len(later), blocks)


class PooledOffset(NamedTuple):
    """What several recordings say together."""

    offset: float  # s
    std: float  # s, of the offset
    between: float  # s, standard deviation of the recordings' own offsets beyond what their errors explain


def pooled(estimates: Sequence[ClockEstimate]) -> PooledOffset:
    """Mean of one estimate or more, each with its own true value. Source: random effects, DerSimonian and Laird 1986."""
    offset, variance = np.array([(e.offset, e.std**2) for e in estimates]).T
    weight = 1.0 / variance
    excess = float(weight @ (offset - weight @ offset / weight.sum()) ** 2) - (len(offset) - 1)
    scale = float(weight.sum() - weight @ weight / weight.sum())
    between = max(0.0, excess / scale) if len(offset) > 1 else 0.0
    weight = 1.0 / (variance + between)
    mean = float(weight @ offset / weight.sum())
    return PooledOffset(mean, math.sqrt(1.0 / weight.sum()), math.sqrt(between))


def _pairs(camera: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of each pose and of the newest one at least LAG before it."""
    later = np.arange(len(camera))
    earlier = np.searchsorted(camera, camera - LAG + 1e-3, side="right") - 1
    good = (earlier >= 0) & (camera - camera[np.maximum(earlier, 0)] <= LONGEST_PAIR)
    return later[good], earlier[good]


def _squares(
    camera: Array,
    headings: Array,
    imu: Array,
    yaw: Array,
    grid: Array,
    later: NDArray[np.int64],
    earlier: NDArray[np.int64],
) -> Array:
    """(P, G) [rad^2] of each pair for each offset."""
    turned = [np.interp(camera[k][:, None] + grid, imu, yaw) for k in (later, earlier)]
    change = (headings[later] - headings[earlier])[:, None] - (turned[0] - turned[1])
    change = np.abs((change + math.pi) % (2.0 * math.pi) - math.pi)
    squares: Array = np.minimum(change, CLIP) ** 2
    return squares


def _sums(squares: Array) -> OffsetSums:
    sums = OffsetSums(math.inf, squares.shape[1])
    sums.add(squares.sum(axis=0), pairs=len(squares))
    return sums


def _jackknife(left_out: Array) -> float:
    """Standard deviation from the estimates without one block each; infinite with one block."""
    n = len(left_out)
    if n < 2:
        return math.inf
    return math.sqrt((n - 1) / n * float(np.sum((left_out - left_out.mean()) ** 2)))
