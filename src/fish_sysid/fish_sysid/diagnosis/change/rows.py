# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the regression: what is measured, what OLD and NEW share, and what each candidate would add in NEW alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.candidates import SIMULATED, Candidate, simulated, written_down
from fish_sysid.diagnosis.change.channels import AT_CENTRES, CHANNELS, HARMONICS, MEANS, Swim
from fish_sysid.diagnosis.symmetry.galilei import asymmetric
from fish_sysid.diagnosis.symmetry.stroke_means import ROTOR

Array = NDArray[np.float64]

# standard deviations of the channels' noise, before OLD tells them: m/s, rad/s, harmonics, rad
FIRST_NOISE = np.array(
    [0.01, 0.01, 0.05, 0.01, *([0.03] * (2 * len(HARMONICS))), 0.1, 0.1, 0.01, 0.03]
)
# channels of the two looks: the mean motion, clocks and scales alone, and with the strokes
MEAN_MOTION = (*range(MEANS), *range(AT_CENTRES, CHANNELS))
STROKES = tuple(range(CHANNELS))
GYRO_BIAS = 0.003  # rad/s, of a trial


@dataclass(frozen=True)
class TrialRows:
    """One trial."""

    name: str
    measured: Array  # (N,), 0 where nothing was measured
    valid: NDArray[np.bool_]  # (N,)
    channel: NDArray[np.int64]  # (N,)
    black_box: Array  # (N, P) what commands and the simulated robot say
    candidates: Mapping[tuple[str, int], Array]  # (name, form) -> (N, K)
    kept: NDArray[np.bool_] | None = None  # (all rows of the trial,) those of a look; None: all


def trial_rows(
    robot: Robot, experiment: Experiment, days: Sequence[Swim], names: Sequence[str]
) -> list[TrialRows]:
    """Rows of these trials with candidates of these names, nominal parameters besides."""
    own, moved = simulated(robot, experiment, days, [n for n in SIMULATED if n in names])
    found = [*(c for c in written_down(days) if c.name in names), *moved]
    return [
        _rows(swim, channels, {key: c.columns[i] for key, c in keyed(found).items()})
        for i, (swim, channels) in enumerate(zip(days, own, strict=True))
    ]


def look(rows: Sequence[TrialRows], channels: Sequence[int]) -> list[TrialRows]:
    """The rows of these channels alone."""
    cut = []
    for r in rows:
        kept = np.isin(r.channel, channels)
        columns = {key: c[kept] for key, c in r.candidates.items()}
        own = r.measured[kept], r.valid[kept], r.channel[kept], r.black_box[kept]
        cut.append(TrialRows(r.name, *own, columns, kept))
    return cut


def keyed(candidates: Sequence[Candidate]) -> dict[tuple[str, int], Candidate]:
    """By name and number of the form."""
    keys: dict[tuple[str, int], Candidate] = {}
    for candidate in candidates:
        form = sum(name == candidate.name for name, _ in keys)
        keys[candidate.name, form] = candidate
    return keys


def _rows(swim: Swim, own: Array, candidates: Mapping[tuple[str, int], Array]) -> TrialRows:
    measured = swim.measured()
    valid = np.isfinite(measured) & np.isfinite(swim.flat(own))
    columns = {
        key: np.where(valid[:, None], np.nan_to_num(c), 0.0) for key, c in candidates.items()
    }
    box = np.where(valid[:, None], np.nan_to_num(black_box(swim, own)), 0.0)
    return TrialRows(swim.name, np.where(valid, measured, 0.0), valid, swim.channel, box, columns)


def black_box(swim: Swim, own: Array) -> Array:
    """Columns (N, P): command features of every channel, and the simulated robot's own channels (C, 12)."""
    means = swim.means
    odd = np.hstack([means.odd, asymmetric(means)])
    features = [means.even, odd, odd, _gyro_features(swim), *_stroke_features(swim)]
    columns = []
    for channel, own_features in enumerate(features):
        for feature in own_features.T:
            columns.append(_at(swim, channel, feature))
        if channel != MEANS - 1:
            columns.append(_at(swim, channel, own[:, channel]))
    for k in range(2):
        window = np.zeros((len(swim.windows), 2))
        window[:, k] = swim.windows[:, 1 + 2 * k]
        columns.append(swim.flat(None, window))
    for column in (*swim.force.base.T, *swim.force.terms.T):
        columns.append(swim.flat(force=column))
    columns.append(swim.flat(turns=swim.turns[:, 1]))
    return np.column_stack(columns)


def _gyro_features(swim: Swim) -> Array:
    """Features (C, 5) of camera's less gyro's yaw rate: a gyro that is read too seldom loses fast turns."""
    r, A = np.nan_to_num(swim.means.gyro), swim.rotor / ROTOR
    return np.column_stack([np.ones_like(r), r, r * np.abs(r), r**3, A * r])


def _stroke_features(swim: Swim) -> list[Array]:
    """Features (C, P) of the harmonics: those that turns mirror and those that they do not."""
    means, A = swim.means, swim.rotor / ROTOR
    straight, slow = means.throttle.T
    slower = np.gradient(A) if len(A) > 1 else 0.0 * A
    f = 2.0 * np.pi * 2.0
    pace = swim.stroke / f - 1.0
    even = np.column_stack(
        [A, A**2, A**3, A * means.even[:, 7], A * straight, A * slow, slower, A * pace]
    )
    odd = np.column_stack(
        [A, A * means.rudder, A * means.odd[:, 1], A**2 * means.rudder, A * means.velocity[:, 2]]
    )
    of_channel = {("gyro", 1): even, ("left", 1): even, ("ahead", 1): odd, ("ahead", 2): even}
    return [of_channel[h] for h in HARMONICS for _ in range(2)]


def _at(swim: Swim, channel: int, values: Array) -> Array:
    centres = np.zeros((len(values), AT_CENTRES))
    centres[:, channel] = values
    return swim.flat(centres)
