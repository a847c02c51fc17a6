# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of an identification and of predictions: errors, parameters, biases, and every prediction for anybody to score."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from fish_report.page import Table
from fish_sim.model import DT
from fish_sim.robot import nominal_parameters
from fish_sysid.estimation.shooting.prediction_fit import with_links
from fish_sysid.identification_result import Identification
from fish_sysid.identification_statements import entangled
from fish_sysid.prediction.baselines import AHEAD, PEEK
from fish_sysid.prediction.prediction import ErrorSizes, Predictions
from fish_sysid.prediction.stroke_average import stroke_mean

NAMES = {
    "start": "physics, before fitting",
    "identified": "physics, identified",
    "constant": "constant speed and yaw rate",
    "arx": "linear ARX",
    "bilinear": "bilinear",
}
# m, m, rad in the pool's frame; m/s, m/s, rad/s in base_link
STATE = ("x", "y", "heading", "u", "v", "r")
COLUMNS = (
    "trial",
    "time",
    "start",
    *(f"predicted_{k}" for k in STATE),
    *(f"measured_{k}" for k in STATE),
)


def error_table(errors: Mapping[str, ErrorSizes], title: str = "Prediction error") -> Table:
    """Rms of position [mm], heading [mrad] and speed [mm/s] at each horizon."""
    horizons = next(iter(errors.values())).horizons
    header = [
        "predictor",
        *(f"{q} {h:g} s" for h in horizons for q in ("mm", "mrad", "mm/s")),
        "predictions",
    ]
    rows = [
        [
            _label(name),
            *(_cell(1e3 * v) for v in e.rms.ravel()),
            " / ".join(map(str, e.counts.sum(0))),
        ]
        for name, e in errors.items()
    ]
    return Table(title, header, rows, _error_note(errors, horizons))


def _error_note(errors: Mapping[str, ErrorSizes], horizons: Sequence[float]) -> str:
    """What the columns and rows that are there mean."""
    *most, last = (f"{h:g}" for h in horizons)
    after = f"{', '.join(most)} and {last}" if most else last
    note = (
        f"Rms errors of position, heading and surge speed after {after} s, averaged over strokes in measurement and "
        "prediction alike; last how many predictions they are of, at each horizon. "
    )
    if not any(name.endswith(AHEAD) for name in errors):
        return note + "Every prediction starts from what was measured before."
    return note + (
        f"All start from what was measured before; below the same with {PEEK:g} s of what comes: the "
        "camera's stroke means at the start, which the baselines are usually given, and for the physics a smoothed state."
    )


def _label(name: str) -> str:
    plain = name.removesuffix(AHEAD)
    return NAMES.get(plain, plain) + (f", with {PEEK:g} s of what comes" if plain != name else "")


def _cell(value: float, digits: int = 3) -> str:
    return "" if np.isnan(value) else f"{value:.{digits}g}"


def parameter_table(result: Identification) -> Table:
    """Value, standard error and ratio to the start of each free parameter."""
    fit, units = result.fit, nominal_parameters(result.fit.robot.links)
    unknown, rows = set(result.undetermined), []
    start = with_links(result.start, fit.robot.links)
    spread = result.predicted.parameter_spread if result.predicted else {}
    for name, value in fit.values.items():
        unit = units[name].unit if name in units else ""
        before = start.parameters.get(name)
        ratio = "" if before is None else f"{value / before:.3f}"
        error = fit.standard_errors[name]
        remark = "not determined by these data" if name in unknown else ""
        relative = f"{100 * error / abs(value):.2g} %" if value else ""
        row = [name, f"{value:.5g}", f"{error:.2g}", unit, ratio, relative, remark]
        rows.append([*row[:3], *([_cell(spread[name], 2)] if spread else []), *row[3:]])
    header = ["parameter", "value", "standard error", "unit", "over start", "relative error", ""]
    note = "Standard errors from the likelihood's curvature, to first order."
    if spread:
        header.insert(3, "spread over folds")
        note = "Standard errors clustered by trial; the spread is the jackknife's over fits without a fold of trials each."
    return Table("Parameters", header, rows, note)


def entangled_table(result: Identification) -> Table:
    """Pairs that the data hardly tell apart."""
    rows = [[a, b, f"{value:+.3f}"] for a, b, value in entangled(result.fit)]
    return Table("Strong correlations", ["parameter", "and", "correlation"], rows)


def bias_table(result: Identification) -> Table:
    """Sensor biases per trial."""
    rows = [
        [name, *(f"{b:+.4f} ± {s:.4f}" for b, s in zip(bias, std, strict=True))]
        for name, bias, std in zip(
            result.training.names, result.estimates.bias, result.estimates.bias_std, strict=True
        )
    ]
    return Table(
        "Sensor biases", ["trial", "gyro, rad/s", "accelerometer forward, m/s²", "left, m/s²"], rows
    )


def noise_table(result: Identification) -> Table:
    """Standard deviations that the fit ended with."""
    n = result.fit.noise
    rows = [
        ["unexplained surge force", f"{n.wrench[0]:.3g}", "N"],
        ["unexplained sway force", f"{n.wrench[1]:.3g}", "N"],
        ["unexplained yaw moment", f"{n.wrench[2]:.3g}", "N m"],
        ["its time constant", f"{n.wrench_time:.3g}", "s"],
        ["gyro", f"{n.gyro:.3g}", "rad/s"],
        ["accelerometer", f"{n.accel:.3g}", "m/s²"],
        ["camera position", f"{n.camera_position:.3g}", "m"],
        ["camera heading", f"{n.camera_heading:.3g}", "rad"],
    ]
    return Table("Noise", ["of", "standard deviation", "unit"], rows)


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
        # earlier ones show the estimate, no prediction
        taken = frames.t - predictions.sensors.camera_latency
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
