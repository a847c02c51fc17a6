# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as a table that anybody can score a model with."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fish_sim.model import DT
from fish_sysid.prediction.prediction import Predictions
from fish_sysid.prediction.stroke_average import stroke_mean

STATE = (
    "x",
    "y",
    "heading",
    "u",
    "v",
    "r",
)  # m, m, rad in the pool's frame; m/s, m/s, rad/s in base_link
COLUMNS = (
    "trial",
    "time",
    "start",
    *(f"predicted_{k}" for k in STATE),
    *(f"measured_{k}" for k in STATE),
)


def write_predictions(path: Path, predictions: Predictions) -> int:
    """Write one row per camera pose; returns their number. Times in s from the trial's first command.

    Where strokes cannot be averaged (first and last half second, gaps) the velocities are empty.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    count = 0
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for row in _rows(predictions):
            writer.writerow(row)
            count += 1
    return count


def _rows(predictions: Predictions) -> Iterator[list[str]]:
    experiment = predictions.estimates.experiment
    for m, frames in enumerate(experiment.frames):
        seen, starts = predictions.seen(m), predictions.start[predictions.trial == m] * DT
        measured = stroke_mean(frames.t, frames.t)(frames.pose)
        taken = (
            frames.t - predictions.sensors.camera_latency
        )  # earlier ones show the estimate, no prediction
        for s, start in enumerate(starts):
            own = np.flatnonzero((taken >= start) & (taken < start + predictions.horizon))
            known = np.isfinite(seen[:, s].sum(axis=1))
            velocity = np.full((len(frames.t), 3), np.nan)
            if known.sum() > 1:
                velocity = stroke_mean(frames.t[known], frames.t)(seen[known, s])[:, 3:]
            for i in own[known[own]]:
                numbers = [*seen[i, s], *velocity[i], *frames.pose[i], *measured[i, 3:]]
                numbers[2], numbers[8] = (
                    float(np.arctan2(np.sin(a), np.cos(a))) for a in (numbers[2], numbers[8])
                )
                cells = ["" if np.isnan(v) else f"{v:.6f}" for v in numbers]
                yield [experiment.names[m], f"{frames.t[i]:.6f}", f"{start:.6f}", *cells]
