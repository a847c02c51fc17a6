# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Images of NEW that are much older, or much newer, than OLD's: camera and gyro say so before anything is compared.

The columns of `camera_latency` are right to first order. From a quarter of a stroke on they are not: images half a second late
in NEW alone leave nothing that they fit, and every other channel is out of step. The p-value is NEW's rank among sets of trials
in its place, as in `permutation_test`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.camera import DELAYS, STEP, align, fine_delay, misfits
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.permutation_test import p_value_of
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.symmetry.finding import Estimate

Array = NDArray[np.float64]

NAME = "camera_latency"
FAR = 0.15  # s, a quarter of a slow stroke: what is less the regression names


@dataclass(frozen=True)
class AgeChange:
    """What camera and gyro say, with NEW's rank among sets of trials in its place."""

    p_value: float
    named: Named
    later: float  # s, how much older NEW's images are than OLD's


def age_change(old: Experiment, new: Experiment, days: Sequence[int] = ()) -> AgeChange | None:
    """A change of the images' age beyond FAR; None where there is none or the gyro cannot tell.

    days (M,): of several days of OLD the number of each trial's day, OLD's trials first.
    """
    if not abs(align(new).delay - align(old).delay) > FAR:
        return None
    (before, error), (of_new, own) = fine_delay(old), fine_delay(new)
    if not np.isfinite([before, error, of_new, own]).all():
        return None
    squares = np.concatenate([misfits(old)[0], misfits(new)[0]])
    first, trials = len(old.names), len(squares)
    ages = _ages(squares)
    p_value = p_value_of(
        lambda rows: _apart(ages, rows), [1] * trials, np.arange(first, trials), days
    )
    gains = _gains(squares[first:], before, of_new)
    change = Estimate(of_new - before, float(np.hypot(error, own)), "s")
    member = Member(NAME, 1.0, np.nan, Refitted({"delay": change}, "", gains))
    return AgeChange(p_value, Named.of((member,)), of_new - before)


def _ages(squares: Array) -> Array:
    """(M,) the best delay of each trial by mean squares (M, D); the middle of all where a trial tells nothing."""
    told: NDArray[np.bool_] = np.asarray(np.isfinite(squares).all(axis=1))
    ages = DELAYS[np.where(told[:, None], squares, 0.0).argmin(axis=1)]
    return np.asarray(np.where(told, ages, np.median(ages[told])))


def _apart(ages: Array, rows: NDArray[np.int64]) -> float:
    """How far the mean of some trials is from that of the others."""
    return abs(float(ages[rows].mean() - np.delete(ages, rows).mean()))


def _gains(squares: Array, before: float, after: float) -> Array:
    """(M,) log of the mean square misfit at OLD's age over that at NEW's; 0 of a trial that tells nothing."""
    at = [int(np.clip(round(delay / STEP), 0, len(DELAYS) - 1)) for delay in (before, after)]
    first, second = np.log(np.maximum(squares[:, at].T, 1e-12))
    return np.asarray(np.nan_to_num(first - second))
