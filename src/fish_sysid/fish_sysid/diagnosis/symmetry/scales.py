# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scale of the gyro, and the camera's heading against the course.

    gyro = factor * camera's yaw rate + bias of the trial
    sway = terms odd in the yaw rate - offset * surge + carried by the water

The second is mirror-averaged: a fish that turns neither way slips neither way, whatever trims its rudder. A hull that is not
mirror-symmetric slips while it swims straight and looks the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.symmetry.finding import (
    FEW_TRIALS,
    Estimate,
    SymmetryFinding,
    SymmetryTest,
)
from fish_sysid.diagnosis.symmetry.galilei import carried, too_few_headings
from fish_sysid.diagnosis.symmetry.regression import Rows, judge
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans
from fish_sysid.estimation.thresholds import (
    FEWEST_TRIALS,
    LEAST_OWN_SHARE,
    LEAST_SPEED,
    LEAST_TURNING,
    SENSOR_GAIN,
    SMALLEST_ANGLE,
    SMALLEST_SCALE,
    SYMMETRY_GAIN,
)

Array = NDArray[np.float64]

LARGEST_RATE = 5.0  # rad/s; a stroke-mean rate beyond it comes from swapped markers

GYRO_SCALE = SymmetryTest(
    "gyro_scale",
    "sensor",
    assumes="the camera's heading is right up to a constant; the gyro's bias is constant in a trial",
    needs="a gyro, three trials, turns",
)
HEADING_OFFSET = SymmetryTest(
    "camera_heading_offset",
    "sensor",
    assumes="a mirror-symmetric hull: hull_asymmetry looks the same",
    needs="three trials, several headings, a fish that swims",
    stands_alone=False,
)


def gyro_scale(trials: Sequence[StrokeMeans]) -> SymmetryFinding:
    """The test for `gyro_scale`: yaw rates of the gyro against those of the camera."""
    felt = [s for s in trials if np.isfinite(s.gyro).all()]
    if not felt:
        return GYRO_SCALE.cannot_tell("no gyro was recorded")
    if len(felt) < FEWEST_TRIALS:
        return GYRO_SCALE.cannot_tell("fewer than three trials with a gyro")
    rows = [_rates(s) for s in felt]
    spread = float(np.concatenate([r.terms[:, 0] for r in rows]).std())
    if spread < LEAST_TURNING:
        return GYRO_SCALE.cannot_tell(f"no turns: yaw rates vary by {spread:.2f} rad/s")
    judged = judge(rows)
    # the regression is of the camera's rate on the gyro's, which is far less noisy, less the gyro's own rate
    slope = 1.0 + float(judged.coefficients[-1])
    factor = Estimate(1.0 / slope, float(judged.std[-1]) / slope**2, "1")
    found = judged.stands(SENSOR_GAIN, -1) and abs(factor.value - 1.0) > SMALLEST_SCALE
    text = f"the gyro reads {factor.value:.3f} times the camera's yaw rate"
    return GYRO_SCALE.answer(found, text, {"factor": factor}, judged.evidence)


def _rates(trial: StrokeMeans) -> Rows:
    """Camera's less gyro's yaw rate on the gyro's, both less their means in the trial, which hold the bias."""
    kept = np.abs(trial.velocity[:, 2]) < LARGEST_RATE
    gyro, camera = trial.gyro[kept], trial.velocity[kept, 2]
    gyro, camera = gyro - gyro.mean(), camera - camera.mean()
    return Rows(np.zeros((len(gyro), 0)), gyro[:, None], camera - gyro)


def heading_offset(trials: Sequence[StrokeMeans]) -> SymmetryFinding:
    """The test for `camera_heading_offset`: course against heading where the fish does not turn."""
    if len(trials) < FEWEST_TRIALS:
        return HEADING_OFFSET.cannot_tell(FEW_TRIALS)
    speed = float(np.concatenate([s.velocity[:, 0] for s in trials]).mean())
    if speed < LEAST_SPEED:
        return HEADING_OFFSET.cannot_tell(f"mean surge of {speed:.3f} m/s: no course")
    judged = judge([Rows(_slip(s), -s.velocity[:, :1], s.velocity[:, 1]) for s in trials])
    if judged.own_share < LEAST_OWN_SHARE:
        return HEADING_OFFSET.cannot_tell(too_few_headings(judged.own_share))
    offset = judged.estimate(-1, "rad")
    found = judged.stands(SYMMETRY_GAIN, -1) and abs(offset.value) > SMALLEST_ANGLE
    text = f"a fish that swims straight is seen at {offset.value:.3f} ± {offset.std:.3f} rad from its course"
    return HEADING_OFFSET.answer(found, text, {"offset": offset}, judged.evidence)


def _slip(trial: StrokeMeans) -> Array:
    """Columns (C, 7) of sway that are odd in the motion, and of the flow."""
    u, _, r = trial.velocity.T
    odd = np.column_stack([trial.odd[:, 0] - trial.odd[:, 1], r, r * u, r * np.abs(r), r**3])
    return np.hstack([odd, carried(trial)[len(u) :]])
