# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scale of the gyro, and the camera's heading against the course.

    gyro = factor * camera's yaw rate + bias of the trial
    sway = terms odd in the yaw rate - offset * surge + carried by the water

The second is mirror-averaged: a fish that turns neither way slips neither way, whatever trims its rudder. A hull that is not
mirror-symmetric slips while it swims straight and looks the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.galilei import TOO_FEW_HEADINGS, carried
from fish_sysid.diagnosis.symmetry.regression import Conclusion, Judged, RegressionTest, Rows
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, Trials
from fish_sysid.estimation.thresholds import (
    LEAST_SPEED,
    LEAST_TURNING,
    SENSOR_GAIN,
    SMALLEST_ANGLE,
    SMALLEST_SCALE,
    SYMMETRY_GAIN,
)

Array = NDArray[np.float64]

LARGEST_RATE = 5.0  # rad/s; a stroke-mean rate beyond it comes from swapped markers
FEWEST_MEANS = 3  # of a trial
TOGETHER = 0.5  # share of the variance of the camera's yaw rate that goes with the gyro's


def _with_gyro(trials: Trials) -> Trials:
    return [s for s in trials if _compared(s).sum() >= FEWEST_MEANS]


def _compared(trial: StrokeMeans) -> NDArray[np.bool_]:
    """Means (C,) at which both say how the fish turns."""
    return np.asarray(np.isfinite(trial.gyro) & (np.abs(trial.velocity[:, 2]) < LARGEST_RATE))


def _not_comparable(trials: Trials) -> str:
    rows = [_rates(s) for s in trials]
    gyro = np.concatenate([r.terms[:, 0] for r in rows])
    camera = gyro + np.concatenate([r.measured for r in rows])
    if (spread := float(gyro.std())) < LEAST_TURNING:
        return f"no turns: yaw rates vary by {spread:.2f} rad/s"
    along = float(np.mean(gyro * camera))  # squared over both variances: the share
    if along > 0.0 and along**2 > TOGETHER * np.mean(gyro**2) * np.mean(camera**2):
        return ""
    return (
        "camera and gyro do not turn together, or the turns are too small for the camera's noise: "
        "look at the clocks and at the camera's heading"
    )


def _rates(trial: StrokeMeans) -> Rows:
    """Camera's less gyro's yaw rate on the gyro's, both less their means in the trial, which hold the bias."""
    kept = _compared(trial)
    gyro, camera = trial.gyro[kept], trial.velocity[kept, 2]
    gyro, camera = gyro - gyro.mean(), camera - camera.mean()
    return Rows(np.zeros((len(gyro), 0)), gyro[:, None], camera - gyro)


def _factor(judged: Judged, _: Trials) -> Conclusion:
    """The regression is of the camera's rate on the gyro's, which is far less noisy, less the gyro's own rate."""
    slope = 1.0 + float(judged.coefficients[-1])
    factor = Estimate(1.0 / slope, float(judged.std[-1]) / slope**2, "1")
    found = judged.stands(SENSOR_GAIN, -1) and abs(factor.value - 1.0) > SMALLEST_SCALE
    text = f"the gyro reads {factor.value:.3f} times the camera's yaw rate"
    return found, text, {"factor": factor}


GYRO_SCALE = RegressionTest(
    "gyro_scale",
    "sensor",
    assumes="the camera's heading is right up to a constant; the gyro's bias is constant in a trial",
    needs="a gyro, three trials, turns",
    usable=_with_gyro,
    few=lambda n: (
        "fewer than three trials with a gyro that does not pause"
        if n
        else "no gyro sample can be used"
    ),
    lacking=_not_comparable,
    rows=_rates,
    conclude=_factor,
)


def _no_course(trials: Trials) -> str:
    speed = float(np.concatenate([s.velocity[:, 0] for s in trials]).mean())
    return f"mean surge of {speed:.3f} m/s: no course" if speed < LEAST_SPEED else ""


def _slip(trial: StrokeMeans) -> Rows:
    """Sway by terms that are odd in the motion and by the flow (C, 7), against the surge."""
    u, v, r = trial.velocity.T
    odd = np.column_stack([trial.odd[:, 0] - trial.odd[:, 1], r, r * u, r * np.abs(r), r**3])
    return Rows(np.hstack([odd, carried(trial)[len(u) :]]), -u[:, None], v)


def _offset(judged: Judged, _: Trials) -> Conclusion:
    offset = judged.estimate(-1, "rad")
    found = judged.stands(SYMMETRY_GAIN, -1) and abs(offset.value) > SMALLEST_ANGLE
    text = f"a fish that swims straight is seen at {offset.value:.3f} ± {offset.std:.3f} rad from its course"
    return found, text, {"offset": offset}


HEADING_OFFSET = RegressionTest(
    "camera_heading_offset",
    "sensor",
    assumes="a mirror-symmetric hull: hull_asymmetry looks the same",
    needs="three trials, several headings, a fish that swims",
    stands_alone=False,
    lacking=_no_course,
    rows=_slip,
    spanned=TOO_FEW_HEADINGS,
    conclude=_offset,
)
