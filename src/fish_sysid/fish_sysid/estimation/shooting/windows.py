# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Windows of raw measurements on which a model is shot: camera poses and the IMU's headings between two grid points.

A window lasts the same number of steps in every trial, so that all windows are simulated side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MARGIN = 0.05  # s at both ends of a window without samples: clocks may move by as much
FEWEST_FRAMES = 4  # that a start state needs
LEAST_SHARE = 0.5  # of the frames that the camera's usual rate gives


@dataclass(frozen=True)
class Samples:
    """Measurements of one sensor in all windows, window by window."""

    window: Index  # (F,)
    t: Array  # (F,) s from the window's start
    value: Array  # (F, ...)


@dataclass(frozen=True)
class Windows:
    """W windows of `steps` steps."""

    trial: Index  # (W,)
    start: Index  # (W,) grid point
    steps: int
    commands: Array  # (steps, W, 2) rotor speed [rad/s], rudder [rad]
    poses: Samples  # value (F, 3) x, y [m], psi [rad]
    headings: Samples  # value (Q,) rad, an unknown constant per window is added

    def __len__(self) -> int:
        return len(self.trial)


def regular_starts(experiment: Experiment, length: float, every: float, first: float) -> Index:
    """(W, 2) trial and grid point of windows of `length` [s], the first at `first` [s], that end within their trial."""
    rows = [
        (m, round(t / DT))
        for m, steps in enumerate(experiment.steps.tolist())
        for t in np.arange(first, (steps - 2) * DT - length, every).tolist()
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def cut(experiment: Experiment, starts: Index, length: float, late: float = MARGIN) -> Windows:
    """Windows of `length` [s] from starts (W, 2); those that the camera hardly covers are left out.

    late: s at the end without samples.
    """
    kept: list[tuple[int, int]] = []
    frames, headings = [], []
    for m, k in starts.tolist():
        seen, felt = experiment.frames[m], experiment.heading_of(m)
        inside = _inside(seen.t, k * DT, length, late)
        if len(inside) < max(FEWEST_FRAMES, LEAST_SHARE * _usual_count(seen.t, length)):
            continue
        turned = _inside(felt.t, k * DT, length, late)
        w = len(kept)
        frames.append((w, seen.t[inside] - k * DT, seen.pose[inside]))
        headings.append((w, felt.t[turned] - k * DT, felt.psi[turned]))
        kept.append((m, k))
    trial, start = np.array(kept, dtype=np.int64).reshape(-1, 2).T
    steps = round(length / DT)
    rows = np.minimum(start + np.arange(steps)[:, None], experiment.steps[trial] - 1)
    return Windows(
        trial,
        start,
        steps,
        experiment.commands[rows, trial],
        _joined(frames, (0, 3)),
        _joined(headings, (0,)),
    )


def _inside(t: Array, start: float, length: float, late: float) -> Index:
    return np.flatnonzero((t >= start + MARGIN) & (t < start + length - late))


def _usual_count(t: Array, length: float) -> float:
    """Frames that a window of this length has at the camera's usual rate."""
    return (length - 2.0 * MARGIN) / float(np.median(np.diff(t))) if len(t) > 1 else np.inf


def _joined(parts: list[tuple[int, Array, Array]], empty: tuple[int, ...]) -> Samples:
    if not parts:
        return Samples(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(empty))
    window = np.repeat([w for w, _, _ in parts], [len(t) for _, t, _ in parts])
    t, value = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
    return Samples(window.astype(np.int64), t, value)
