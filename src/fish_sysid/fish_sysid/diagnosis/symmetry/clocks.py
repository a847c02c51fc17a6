# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Clocks: the camera's against the gyro's, the encoder's against the command's, the IMU's against the command's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, sem
from scipy.stats import t as student

from fish_sim.model import DT
from fish_sysid.dataset.camera import DELAYS, Alignment
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.symmetry.finding import Estimate, Evidence, SymmetryFinding, SymmetryTest
from fish_sysid.diagnosis.symmetry.regression import evidence, jackknife
from fish_sysid.estimation.thresholds import (
    FEWEST_TRIALS,
    SMALLEST_DEAD_TIME,
    SMALLEST_SQUARE,
    SYMMETRY_GAIN,
    SYMMETRY_LEVEL,
)

Array = NDArray[np.float64]

# mean square at the worst delay over that at the best, below which the fish hardly turned
SHARP = 2.0
DEAD_TIMES = np.arange(0, 31)  # grid points by which the encoder may be late
STILL_ROTOR, MOVING_ROTOR = 1.0, 10.0  # rad/s of the rotor's command before and after a start
REST = 0.5  # s, that the rotor must have stood before a start
EARLY = 0.05  # s; a start is seen in the command a little after it
STROKE = 0.5  # s; a fish answers its rotor within one stroke
CHANCE = float(norm.sf(3.0))  # probability that the mean over trials is beyond a limit by chance
BEYOND_NOISE = 6.0  # standard deviations of the gyro at rest
LEAST_NOISE = 1e-3  # rad/s, a gyro's resolution

CAMERA_CLOCK = SymmetryTest(
    "camera_latency",
    "sensor",
    assumes="camera and gyro show the same heading; the gyro's bias is constant for four seconds",
    needs="a gyro, three trials of six seconds, turns",
)
ENCODER_CLOCK = SymmetryTest(
    "encoder behind the command",
    "actuator",
    assumes="the rotor follows its command: a lag of the rotor and late stamps of the encoder look the same",
    needs="an encoder, three trials, a rotor whose command changes",
)
IMU_CLOCK = SymmetryTest(
    "IMU against the command",
    "sensor",
    assumes="a rotor that starts turns the head at once; finer than a stroke no statement is possible without a model",
    needs="a gyro, three trials in which the rotor stands for half a second and then starts",
)


def camera_clock(experiment: Experiment, alignment: Alignment) -> SymmetryFinding:
    """The test for `camera_latency`: headings of the camera against those of the gyro."""
    if not np.isfinite(experiment.gyro).any():
        return CAMERA_CLOCK.cannot_tell("no gyro sample can be used")
    squares = alignment.squares
    if len(squares) < FEWEST_TRIALS:
        return CAMERA_CLOCK.cannot_tell("fewer than three trials are long enough")
    total = squares.mean(axis=0)
    if total.max() < SHARP * total.min():
        return CAMERA_CLOCK.cannot_tell("no turns: every delay fits as well")
    delay, told, better = _best_delay(squares)
    text = f"images are {delay.value:.2f} s older than their stamps"
    return CAMERA_CLOCK.answer(alignment.delay > 0.0 and better, text, {"delay": delay}, told)


def _best_delay(squares: Array) -> tuple[Estimate, Evidence, bool]:
    """The best delay by mean squares (M, D) of M trials at DELAYS[:D], its gain over none, and whether that counts.

    Its standard error is that of the jackknife over trials and of the grid together.
    """
    best = int(squares.mean(axis=0).argmin())
    others = [int(np.delete(squares, m, 0).mean(axis=0).argmin()) for m in range(len(squares))]
    told = evidence(np.array([np.log(squares[m, 0] / squares[m, o]) for m, o in enumerate(others)]))
    spread = float(jackknife(DELAYS[others][:, None])[0])
    delay = Estimate(float(DELAYS[best]), float(np.hypot(spread, DT / np.sqrt(12.0))), "s")
    return delay, told, told.gain > SYMMETRY_GAIN and told.p_value < SYMMETRY_LEVEL


def encoder_clock(experiment: Experiment) -> SymmetryFinding:
    """By how much the encoder's speed is behind the commanded one."""
    if not np.isfinite(experiment.encoder).any():
        text = "no encoder sample is left to compare: none can be used, or the measured speed drives the model"
        return ENCODER_CLOCK.cannot_tell(text)
    rows = [_behind(experiment, m) for m in range(len(experiment.names))]
    squares = np.array([row for row in rows if row is not None])
    if len(squares) < FEWEST_TRIALS:
        return ENCODER_CLOCK.cannot_tell("the rotor changes in fewer than three trials")
    delay, told, better = _best_delay(squares)
    found = better and delay.value >= SMALLEST_DEAD_TIME
    text = f"the encoder is {delay.value:.2f} s behind the command"
    return ENCODER_CLOCK.answer(found, text, {"delay": delay}, told)


def _behind(experiment: Experiment, m: int) -> Array | None:
    """Mean squares (D,) of encoder less the command D grid points before; None where the rotor never changes."""
    steps = int(experiment.steps[m])
    command, seen = experiment.commands[:steps, m, 0], experiment.encoder[:steps, m]
    known = np.flatnonzero(np.isfinite(seen))
    known = known[known >= DEAD_TIMES[-1]]
    if len(known) < len(DEAD_TIMES) or np.ptp(command) < MOVING_ROTOR:
        return None
    apart = seen[known] - command[known - DEAD_TIMES[:, None]]
    return np.asarray(np.maximum((apart**2).mean(axis=1), SMALLEST_SQUARE))


def imu_clock(experiment: Experiment) -> SymmetryFinding:
    """How long after the rotor's start the gyro moves: before it no fish does, and none waits for a stroke.

    The mean over M trials must be beyond by Student's t with M - 1 degrees of freedom.
    """
    if not np.isfinite(experiment.gyro).any():
        return IMU_CLOCK.cannot_tell("no gyro sample can be used")
    answers = [_answer_time(experiment, m) for m in range(len(experiment.names))]
    times = np.array([t for t in answers if t is not None])
    if len(times) < FEWEST_TRIALS:
        text = f"{len(times)} trials in which the rotor starts from rest, fewer than three"
        return IMU_CLOCK.cannot_tell(text)
    middle, std = float(times.mean()), float(sem(times))
    unsure = std * float(student.isf(CHANCE, len(times) - 1))
    found = middle + unsure < -EARLY or middle - unsure > STROKE
    text = f"the gyro moves {middle:.2f} s after the rotor's start"
    return IMU_CLOCK.answer(found, text, {"answer": Estimate(middle, std, "s")})


def _answer_time(experiment: Experiment, m: int) -> float | None:
    """Seconds from the rotor's first start to the gyro's answer; None without such a start."""
    steps = int(experiment.steps[m])
    command, gyro = np.abs(experiment.commands[:steps, m, 0]), experiment.gyro[:steps, m]
    start = int(np.argmax(command > STILL_ROTOR))
    rest = round(REST / DT)
    if start < rest or command.max() < MOVING_ROTOR or np.isnan(gyro[: start - rest // 2]).all():
        return None
    before = gyro[: start - rest // 2]
    noise = max(float(np.nanstd(before)), LEAST_NOISE)
    moved = np.flatnonzero(
        np.abs(gyro[start - rest // 2 :] - np.nanmean(before)) > BEYOND_NOISE * noise
    )
    return None if len(moved) == 0 else DT * (int(moved[0]) - rest // 2)
