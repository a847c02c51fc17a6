# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Can OLD and NEW be compared? Which trials are left out, and which are of one kind?"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, prod

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial import cKDTree

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.channels import Swim, swims
from fish_sysid.diagnosis.symmetry.stroke_means import ROTOR

Array = NDArray[np.float64]

FEWEST_OLD, FEWEST_NEW = 6, 3  # trials
FEWEST_WAYS = 100  # in which NEW's number of trials is chosen of all; with fewer nothing is rare at the level of 1 %
SENSORS = (("gyro", "a gyro"), ("accel", "an accelerometer"))
UNITS = 8.0  # ratio of sizes that no change of a fish makes: degrees to radians are 57, millimetres to metres 1000
NEAR = 0.5  # of a command's spread: commands within it are alike
COMMON = 0.5  # share of NEW's stroke means with an OLD one nearby
MOST_KINDS = 3
FEWEST_EXCHANGES = 250  # different sets of trials that can stand for NEW
FAR_OUT = 6.0  # times the median of the other trials' residuals, in mean squares


class NotComparableError(ValueError):
    """OLD and NEW cannot be compared; the message says why and what would be needed."""

    def __init__(self, text: str, left_out: Sequence[str] = ()) -> None:
        super().__init__(text)
        self.left_out = tuple(left_out)  # trials that were, and why


def check_sensors(old: Experiment, new: Experiment) -> None:
    """Raises NotComparableError where a sensor is missing in one of them, or its numbers are of another unit."""
    for key, text in SENSORS:
        has = [bool(np.isfinite(getattr(e, key)).any()) for e in (old, new)]
        if has[0] != has[1]:
            with_it, without = ("OLD", "NEW") if has[0] else ("NEW", "OLD")
            raise NotComparableError(
                f"{with_it} has {text} and {without} has none; expected the same topics in both; record {without} with it"
            )
    for text, a, b in (
        ("rotor speed", old.given_commands[:, 0], new.given_commands[:, 0]),
        ("rudder", old.given_commands[:, 1], new.given_commands[:, 1]),
        ("position", _places(old), _places(new)),
        ("yaw rate of the gyro", old.gyro, new.gyro),
    ):
        sizes = [_size(x, 0.9) for x in (a, b)]
        if (_size(a, 1.0) > 0.0) != (_size(b, 1.0) > 0.0):
            still, other = ("NEW", "OLD") if _size(a, 1.0) > 0.0 else ("OLD", "NEW")
            raise NotComparableError(
                f"{text}: 0 throughout {still} and not in {other}; expected it to move in both; "
                f"record {still} with programs of {other}, and look whether this is logged"
            )
        if min(sizes) > 0.0 and max(sizes) / min(sizes) > UNITS:
            raise NotComparableError(
                f"{text}: 90 % are below {sizes[0]:.3g} in OLD and below {sizes[1]:.3g} in NEW; expected equal units; "
                "record both with the same driver and programs"
            )


def _size(values: Array, share: float) -> float:
    """What this share of the values is below; 0 without any."""
    return float(np.nanquantile(np.abs(values), share)) if np.isfinite(values).any() else 0.0


def _places(experiment: Experiment) -> Array:
    """Positions less where each trial starts."""
    return np.concatenate([(f.pose[:, :2] - f.pose[0, :2]).ravel() for f in experiment.frames])


def screened(experiment: Experiment, which: str) -> tuple[tuple[Swim, ...], list[str]]:
    """The swims that go ahead, and why each other trial is left out."""
    days = swims(experiment)
    kept = tuple(swim for swim in days if not swim.backwards)
    told = [f"{which} {swim.name}: swims backwards in the mean" for swim in days if swim.backwards]
    long = {swim.name for swim in days}
    told += [
        f"{which} {name}: too short, or too few images"
        for name in experiment.names
        if name not in long
    ]
    return kept, told


def check_counts(old: Sequence[Swim], new: Sequence[Swim], left_out: Sequence[str] = ()) -> None:
    """Raises NotComparableError, with what was left out, for too few trials, or without common commands."""
    for which, days, fewest in (("OLD", old, FEWEST_OLD), ("NEW", new, FEWEST_NEW)):
        if len(days) < fewest:
            raise NotComparableError(
                f"{which} has {len(days)} usable trials; expected at least {fewest}; record more with the same programs",
                left_out,
            )
    ways = comb(len(old) + len(new), len(new))
    if ways < FEWEST_WAYS:
        raise NotComparableError(
            f"{len(old)} usable trials of OLD and {len(new)} of NEW can be exchanged in {ways} ways; "
            f"expected at least {FEWEST_WAYS}, as of seven and three; record more with the same programs",
            left_out,
        )
    a, b = (np.concatenate([_commands(s) for s in days]) for days in (old, new))
    spread = np.maximum(a.std(axis=0), 1e-2)
    distance, _ = cKDTree(a / spread).query(b / spread)
    common = float((distance < NEAR).mean())
    if common < COMMON:
        raise NotComparableError(
            f"{common:.1%} of NEW swims as OLD did (throttle, rudder); expected at least {COMMON:.0%}; "
            "record NEW with programs of OLD",
            left_out,
        )


def _commands(swim: Swim) -> Array:
    """(C, 3) throttle of the last second, of the second before, and rudder."""
    return np.column_stack([swim.means.throttle, swim.means.rudder])


def far_out(names: Sequence[str], rest: Array, old: int) -> list[str]:
    """Names of OLD's trials of mean square residuals (M,) that are far beyond the others'."""
    usual = float(np.median(rest[:old]))
    return [
        name for name, square in zip(names[:old], rest, strict=False) if square > FAR_OUT * usual
    ]


def kinds(old: Sequence[Swim], new: Sequence[Swim]) -> list[int]:
    """Kind of each trial, OLD's first: by throttle, rudder and how the rudder moves.

    As many kinds as leave at least as many of OLD as of NEW in each of NEW's, and FEWEST_EXCHANGES in all: with fewer no
    change is rare among exchanged trials.
    """
    rows = []
    for swim in (*old, *new):
        rudder = swim.means.rudder
        rows.append([swim.rotor.mean() / ROTOR, np.abs(rudder).mean(), rudder.std()])
    features = np.array(rows)
    features = (features - features.mean(axis=0)) / np.maximum(features.std(axis=0), 1e-6)
    tree = linkage(features, "ward")
    for count in range(MOST_KINDS, 1, -1):
        kind = fcluster(tree, count, "maxclust")
        first, second = kind[: len(old)], kind[len(old) :]
        sizes = [(int((kind == k).sum()), int((second == k).sum())) for k in np.unique(second)]
        enough = prod(comb(both, own) for both, own in sizes) > FEWEST_EXCHANGES
        if enough and all((first == k).sum() >= (second == k).sum() for k in np.unique(second)):
            return [int(k) for k in kind]
    return [1] * len(features)
