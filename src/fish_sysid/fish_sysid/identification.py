# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify a robot from recordings: parameters with standard errors, and how well they predict unseen trials.

First windows of raw measurements ask whether the model can follow the fish at all. Where it can, its likelihood is right and
says most. Where it cannot, the likelihood misleads, and the robot is fitted to predictions over seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import (
    Alignment,
    ahead_of,
    align,
    at_centre_of_mass,
    moved_back,
    with_marker,
)
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import FEWEST_POSES
from fish_sysid.dataset.imu import imu_moved_back
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, initial_noise
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE, Parametrization, nominal_hypothesis
from fish_sysid.estimation.refit import ANNEAL_HELD, refit, refit_if_suspect
from fish_sysid.estimation.shooting.prediction_fit import LINKS, PredictionFit, fit_predictions
from fish_sysid.estimation.shooting.schedule import TOO_FAR, can_be_predicted, misfit
from fish_sysid.estimation.shooting.selection import INTRINSIC
from fish_sysid.estimation.thresholds import INNOVATION_RMS_REJECT, RATIO_REJECT
from fish_sysid.identification_result import Identification, trust_of
from fish_sysid.identification_statements import (
    AGE_UNKNOWN,
    data_statements,
    fit_statements,
    lag_statements,
    lost_statements,
    prediction_statements,
    start_statements,
    verdict,
)
from fish_sysid.prediction.baselines import judge
from fish_sysid.prediction.better_states import better_states
from fish_sysid.prediction.kept_noise import with_noise
from fish_sysid.prediction.prediction import estimate

Array = NDArray[np.float64]

ADDED = 0.2  # s, delay of the camera that predictions may find beyond the gyro's
EFFECT_START = 0.3  # typical strengths, at which the fit of an effect starts
SO_FITTED = (
    "it lacks something, so that it was fitted to predictions over 0.5 to 5 s instead of the likelihood; standard errors are "
    "clustered by trial; `--effects choose` adds what predictions ask for, and `robofish diagnose` looks for what is missing"
)
FITTED_FOR_OUTLOOK = (
    "the model needs sensors far noisier than they are, or water far stronger than in any pool: "
    + SO_FITTED
)
CANNOT_FOLLOW = (
    "no start state lets the model follow two seconds of swimming within twice the camera's noise: "
    + SO_FITTED
)
TOO_SHORT = (
    "the model needs sensors far noisier than they are, or water far stronger than in any pool, and no trial is long enough to "
    "fit predictions over seconds: values and standard errors are not to be trusted; record trials of 12 s and more"
)
NOT_CHOSEN = "no effects looked for: the model follows the fish, and its likelihood can be believed; `robofish diagnose` asks it"
Report = Callable[[str], None]  # told what is being done


@dataclass(frozen=True)
class Fitted:
    """A fit, the trials as it sees them, and what it has to say."""

    fit: Fit
    experiment: Experiment  # all trials, delays taken out
    camera_delay: float
    imu_delay: float
    statements: tuple[str, ...]
    predicted: PredictionFit | None = None
    states: str = "filter"  # how the states that predictions start from are estimated


def identify(
    experiment: Experiment,
    robot: Robot,
    noise: Noise | None = None,
    hold_out: int = 4,
    free: tuple[str, ...] = NOMINAL_FREE,
    report: Report = lambda _: None,
    effects: tuple[str, ...] = (),
    choose_from: tuple[str, ...] = (),
    links: tuple[int, ...] = LINKS,
) -> Identification:
    """Fit the nominal parameters (and those of the robot's effects in `free`) and judge them on trials left out.

    hold_out: every so-manieth trial takes no part in fitting; 0: none. Raises ValueError when it is negative or 1.
    effects: names added to the robot's, their parameters free. choose_from: where the model is wrong beyond its noise, those
    of these effects are added that let it predict training trials better when they are left out in turn. links: numbers of
    links of the tail that a robot fitted to predictions may have.
    A delay of the camera that the robot states, or else the gyro shows, is taken out of all trials first, so that horizons
    count from the moment an image was taken, and goes into the robot that comes back; so does the place of the camera's point.
    """
    began, ahead = time.monotonic(), ahead_of(robot)
    experiment, robot = at_centre_of_mass(experiment, ahead), with_marker(robot, -ahead)
    train, held = split(len(experiment.names), hold_out)
    lag, unknown = Alignment(0.0, np.nan, np.nan), False
    stated = robot.sensors.get("camera_latency")
    if not any(name.startswith("camera_latency") for name in (*effects, *free)):
        lag = replace(lag, delay=stated["delay"]) if stated else align(experiment.select(train))
        unknown = not stated and bool(np.isnan(lag.rms))
        robot = robot.without_effect("camera_latency")
    experiment, unseen = with_poses_left(experiment, lag.delay)
    train, held = split(len(experiment.names), hold_out)
    moved = moved_back(experiment, lag.delay)
    training = moved.select(train)
    # what trials left out say of the sensors takes no part either
    noise = noise or usual_noise(training)
    report("can the model follow the fish?")
    why, fitted = CANNOT_FOLLOW, None
    follows = misfit(training, robot, noise, free) <= TOO_FAR
    predictable = can_be_predicted(training)
    if follows or not predictable:
        fit, wrong = by_likelihood(training, robot, noise, free, effects, report)
        why, said = FITTED_FOR_OUTLOOK, (NOT_CHOSEN,) if choose_from else ()
        if not predictable and (wrong or not follows):
            wrong, said = False, (TOO_SHORT,)
        fitted = None if wrong else Fitted(fit, moved, lag.delay, 0.0, said)
    if fitted is None:
        fitted = by_predictions(
            experiment, train, lag, robot, noise, free, effects, choose_from, links, report
        )
        fitted = replace(fitted, statements=(why, *fitted.statements))
    found = concluded(experiment, train, held, lag, robot, fitted, report, began)
    unseen += [AGE_UNKNOWN] if unknown else []
    return replace(found, ahead=ahead, statements=(*unseen, *found.statements))


def with_poses_left(experiment: Experiment, delay: float) -> tuple[Experiment, list[str]]:
    """The trials with poses left when images are moved back by this delay [s] and what predictions add; the others in words."""
    if not delay:
        return experiment, []
    left = [int((frames.t >= delay + ADDED).sum()) for frames in experiment.frames]
    kept = [m for m, count in enumerate(left) if count >= FEWEST_POSES]
    return experiment.select(kept), [
        f"{name}: not used: images are {delay:.2f} s older than their stamps, so that only {count} camera poses were taken well "
        f"after the first command; at least {FEWEST_POSES} are needed; record longer trials"
        for name, count in zip(experiment.names, left, strict=True)
        if count < FEWEST_POSES
    ]


def by_likelihood(
    training: Experiment,
    robot: Robot,
    noise: Noise,
    free: tuple[str, ...],
    effects: tuple[str, ...],
    report: Report,
) -> tuple[Fit, bool]:
    """The likeliest robot, and whether its noise is no sensor's or its force no water's."""
    hypothesis = nominal_hypothesis(robot, free)
    for name in effects:
        hypothesis = hypothesis.with_effect(name, EFFECT_START)
    # not from many places: of a wrong model's optima the likelihood does not tell which predicts, and this way is measured
    fit = refit(
        hypothesis, hypothesis.parametrization.origin(), training, noise, ANNEAL_HELD, report
    )
    if is_wrong(fit, noise):
        return fit, True
    return refit_if_suspect(fit, training, report), False


def by_predictions(
    experiment: Experiment,
    train: list[int],
    lag: Alignment,
    robot: Robot,
    noise: Noise,
    free: tuple[str, ...],
    effects: tuple[str, ...],
    choose_from: tuple[str, ...],
    links: tuple[int, ...],
    report: Report,
) -> Fitted:
    """The robot that predicts best over seconds, and the clocks that it finds."""
    training = moved_back(experiment, lag.delay).select(train)
    moving = tuple(name for name in effects if name in EFFECTS)
    found = fit_predictions(
        training, robot, free, moving, choose_from, report, links, together=INTRINSIC
    )
    aside = [name for name in effects if name not in moving]
    not_fitted = [
        f"{', '.join(aside)}: not fitted; predictions fit the sensors' clocks, the camera's heading offset and its point alone"
    ]
    clocks = found.sensors
    camera = max(lag.delay + clocks["camera_latency.delay"], 0.0)
    imu = max(clocks["imu_latency.delay"], 0.0)
    moved = imu_moved_back(moved_back(experiment, camera), imu)
    hypothesis, theta, covariance = found.with_camera()
    report("noise")
    found_robot = Parametrization(hypothesis).robot(theta)
    centred = at_centre_of_mass(moved.select(train), ahead_of(found_robot))
    own = initial_noise(centred, found_robot.without_effect("disturbance"), noise)
    fit = evaluate(hypothesis, theta, centred, own)
    fit = replace(fit, information=np.asarray(np.linalg.inv(covariance), dtype=float))
    report("which states predict better")
    states = better_states(
        moved.select(train), fit.robot.without_effect("disturbance"), own, found.found.trust
    )
    return Fitted(
        fit,
        moved,
        camera,
        imu,
        (*prediction_statements(found), *(not_fitted if aside else [])),
        found,
        states,
    )


def concluded(
    experiment: Experiment,
    train: list[int],
    held: list[int],
    lag: Alignment,
    start: Robot,
    fitted: Fitted,
    report: Report,
    began: float,
) -> Identification:
    """The fit judged on trials left out."""
    fit, moved = fitted.fit, fitted.experiment
    training, held_out = moved.select(train), moved.select(held) if held else None
    report("predicting trials left out")
    robot = with_noise(
        fit.robot.without_effect("disturbance"),
        fit.noise,
        fitted.states,
        trust_of(fitted.predicted),
    )
    judged, errors, lacking = judge(training, held_out, start, robot, fit.noise)
    statements = (
        *data_statements(experiment, held_out),
        *lag_statements(lag),
        *fit_statements(fit, fitted.predicted),
        *lost_statements(training, fit),
        *fitted.statements,
        *lacking,
        *start_statements(errors),
        *verdict(errors),
    )
    return Identification(
        fit,
        start,
        training,
        held_out,
        judged,
        estimate(training, fit.robot.without_effect("disturbance"), fit.noise),
        errors,
        statements,
        time.monotonic() - began,
        fitted.camera_delay,
        fitted.imu_delay,
        fitted.predicted,
        fitted.states,
    )


def is_wrong(fit: Fit, noise: Noise) -> bool:
    """The model needs sensors far noisier than they are said to be, or a force that no water has: the likelihood misleads."""
    told = [
        (getattr(fit.noise, key), getattr(noise, key))
        for key in ("gyro", "camera_position", "camera_heading")
    ]
    return any(needed > INNOVATION_RMS_REJECT * said for needed, said in told) or bool(
        fit.largest_ratio > RATIO_REJECT
    )


def split(trials: int, hold_out: int) -> tuple[list[int], list[int]]:
    """Indices of training and held-out trials: every `hold_out`-th, the last one of a small set, none of a single one."""
    if hold_out < 0 or hold_out == 1:
        raise ValueError(
            f"hold-out {hold_out}: expected 0 (none) or at least 2 (every second trial)"
        )
    if hold_out == 0 or trials == 1:
        return list(range(trials)), []
    held = list(range(hold_out - 1, trials, hold_out)) or [trials - 1]
    return [i for i in range(trials) if i not in held], held
