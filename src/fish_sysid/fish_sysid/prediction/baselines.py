# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a physics model has to beat, three predictors that know nothing of the fish's mechanics, and the errors of all.

    constant    speed and yaw rate stay as they are
    arx         linear: y_k = A1 y_k-1 + A2 y_k-2 + B1 w_k + B2 w_k-1 + c, y = (u, v, r), w = (sqrt(throttle), alpha)
    bilinear    u' = a0 + a1 u + a2 sqrt(throttle),  r_k = b0 + b1 (alpha u)_k + b2 (alpha u)_k-1 + b3 r_k-1,  v = c r

fitted to stroke means of the training trials by least squares. They start from the camera's stroke means. One at the start
point would know half a second of what comes; to be judged in earnest they start from the last mean that ends there (`lead` =
HALF_WINDOW) and run half a second longer. Errors are those of trials that took no part in a fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import initial_noise
from fish_sysid.prediction.prediction import (
    EVERY,
    HORIZONS,
    WARM_UP,
    ErrorSizes,
    Predictions,
    predict,
    prediction_errors,
)
from fish_sysid.prediction.stroke_average import HALF_WINDOW, stroke_mean

Array = NDArray[np.float64]

# rad/s^2, of the rotor at full throttle: 12 rad at 2 Hz
FULL_ACCELERATION = 12.0 * (4.0 * np.pi) ** 2
STEP = 0.25  # s, period of the baselines
STRIDE = round(STEP / DT)
OUTLOOK = 3.0  # s, over which the bilinear model's surge is fitted
RIDGE = 1e-6  # of each regressor's mean square: keeps constant commands solvable
BASELINES = ("constant", "arx", "bilinear")
AHEAD, PEEK = "_ahead", HALF_WINDOW  # suffix of predictors that know so many s of what comes


@dataclass(frozen=True)
class Table:
    """Stroke means of one trial every STEP; rows of NaN where the camera does not cover the window."""

    y: Array  # (N, 3) u, v [m/s], r [rad/s]
    w: Array  # (N, 2) sqrt(throttle), alpha [rad]


def inputs(experiment: Experiment) -> Array:
    """(T, M, 2) square root of the throttle and rudder command [rad], both averaged with the window of `motion`.

    The rotor's acceleration has the amplitude A w^2, so that sqrt(throttle) = A w^2 / FULL_ACCELERATION.
    """
    rotor, rudder = experiment.commands[..., 0], experiment.commands[..., 1]
    acceleration = np.diff(rotor, axis=0, prepend=rotor[:1]) / DT
    power = _smooth(acceleration**2, experiment)
    return np.stack(
        [np.sqrt(2.0 * power) / FULL_ACCELERATION, _smooth(rudder, experiment)], axis=-1
    )


def _smooth(values: Array, experiment: Experiment) -> Array:
    """Hann mean over HALF_WINDOW to both sides, within each trial."""
    half = round(HALF_WINDOW / DT)
    kernel = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / half) ** 2
    valid = (np.arange(len(values))[:, None] < experiment.steps).astype(float)
    out = np.empty_like(values)
    for m in range(values.shape[1]):
        total = np.convolve(values[:, m] * valid[:, m], kernel)[half:-half]
        out[:, m] = total / np.maximum(np.convolve(valid[:, m], kernel)[half:-half], 1e-9)
    return out


def tables(experiment: Experiment) -> list[Table]:
    """Stroke means of every trial."""
    w, out = inputs(experiment), []
    for m, frames in enumerate(experiment.frames):
        k = np.arange(0, experiment.steps[m], STRIDE)
        out.append(Table(stroke_mean(frames.t, k * DT)(frames.pose)[:, 3:], w[k, m]))
    return out


def _solve(rows: list[Array], targets: list[Array]) -> Array:
    """Least squares over the rows without NaN; raises ValueError when there are fewer rows than unknowns."""
    A, b = np.concatenate(rows), np.concatenate(targets)
    good = np.isfinite(A).all(1) & np.isfinite(b).reshape(len(b), -1).all(1)
    A, b = A[good], b[good]
    if len(A) <= A.shape[1]:
        raise ValueError(
            f"{len(A)} rows of stroke means for {A.shape[1]} numbers: the training trials are too short"
        )
    ridge = RIDGE * np.diag(np.sum(A**2, axis=0) + 1e-12)
    theta: Array = np.linalg.solve(A.T @ A + ridge, A.T @ b).astype(float)
    return theta


# (y_k, y_k-1, w_k+1, w_k), each (S, .) -> y_k+1 (S, 3)
Advance = Callable[[Array, Array, Array, Array], Array]


def constant() -> Advance:
    """Speed and yaw rate stay."""
    return lambda y, _y_before, _w, _w_before: y


def fit_arx(data: list[Table]) -> Advance:
    """Second-order linear model."""
    rows = [
        np.column_stack([d.y[1:-1], d.y[:-2], d.w[2:], d.w[1:-1], np.ones(len(d.y) - 2)])
        for d in data
    ]
    theta = _solve(rows, [d.y[2:] for d in data])
    return lambda y, y_before, w, w_before: (
        np.column_stack([y, y_before, w, w_before, np.ones(len(y))]) @ theta
    )


def fit_bilinear(data: list[Table]) -> Advance:
    """Surge acceleration from speed and sqrt(throttle), yaw rate from alpha times speed with a lag, sway from yaw rate."""
    a = _fit_surge(data)
    product = [d.w[:, 1] * d.y[:, 0] for d in data]
    rows = [
        np.column_stack([np.ones(len(x) - 1), x[1:], x[:-1], d.y[:-1, 2]])
        for x, d in zip(product, data, strict=True)
    ]
    b = _solve(rows, [d.y[1:, 2] for d in data])
    c = _solve([d.y[:, 2:] for d in data], [d.y[:, 1] for d in data])

    def advance(y: Array, y_before: Array, w: Array, w_before: Array) -> Array:  # noqa: ARG001
        u = _surge(a, y[:, 0], w[:, 0], w_before[:, 0])
        r = b[0] + b[1] * w[:, 1] * u + b[2] * w_before[:, 1] * y[:, 0] + b[3] * y[:, 2]
        return np.column_stack([u, c[0] * r, r])

    return advance


def _surge(a: Array, u: Array, throttle: Array, throttle_before: Array) -> Array:
    """Speed one STEP later: u' = a0 + a1 u + a2 sqrt(throttle)."""
    ahead: Array = u + STEP * (a[0] + a[1] * u + a[2] * 0.5 * (throttle + throttle_before))
    return ahead


def _fit_surge(data: list[Table]) -> Array:
    """a (3,) that predicts best over OUTLOOK: single differences would take the noise in u for damping."""
    n = round(OUTLOOK / STEP)
    windows = [
        (d.y[k : k + n + 1, 0], d.w[k : k + n + 1, 0])
        for d in data
        for k in range(0, len(d.y) - n, 2)
    ]
    windows = [(u, w) for u, w in windows if np.isfinite(u).all()]
    if not windows:
        raise ValueError(f"no training trial has {OUTLOOK:g} s of camera poses without a gap")
    u, w = (np.array(column).T for column in zip(*windows, strict=True))

    def misfit(a: Array) -> Array:
        now, errors = u[0], []
        for k in range(n):
            now = _surge(a, now, w[k + 1], w[k])
            errors.append(now - u[k + 1])
        return np.concatenate(errors)

    found: Array = least_squares(
        misfit, np.array([0.0, -0.5, 0.1]), bounds=([-1, -3, -3], [1, 0, 3])
    ).x
    return found


def fit_baselines(training: Experiment) -> dict[str, Advance]:
    """The three baselines by name; raises ValueError when the training trials are too short."""
    data = [t for t in tables(training) if len(t.y) > 2]
    if not data:
        raise ValueError("no training trial is long enough for the baselines")
    return {"constant": constant(), "arx": fit_arx(data), "bilinear": fit_bilinear(data)}


def predict_baseline(advance: Advance, like: Predictions, lead: float = 0.0) -> Predictions:
    """The baseline's predictions from the start points of `like`, begun from stroke means `lead` [s] before them.

    lead: a multiple of STEP.
    """
    experiment, early = like.estimates.experiment, round(lead / STEP) * STRIDE
    length = len(like.pose) - 1 + early
    w = inputs(experiment)
    measured = _measured(like, early)
    y, y_before = measured[:, 3:], _measured(like, early + STRIDE)[:, 3:]
    pose = np.empty((length + 1, *like.pose.shape[1:]))
    pose[0] = measured[:, :3]
    for begin in range(0, length, STRIDE):
        now, then = (
            w[np.clip(like.start - early + k, 0, experiment.length - 1), like.trial]
            for k in (begin, begin + STRIDE)
        )
        y, y_before = advance(y, y_before, then, now), y
        count = min(STRIDE, length - begin)
        pose[begin + 1 : begin + count + 1] = _travel(pose[begin], y_before, y)[:count]
    pose = pose[early:]
    pose[np.isnan(like.pose)] = np.nan
    # the baselines predict what the camera shows, its errors and its point included; only its clock is taken out
    shown = replace(like.sensors, camera_heading_offset=0.0, camera_scale=1.0)
    return replace(like, pose=pose, sensors=shown, ahead=0.0)


def _travel(pose: Array, y: Array, y_next: Array) -> Array:
    """(STRIDE, S, 3) poses every 10 ms from pose (S, 3) with velocities that go from y to y_next linearly."""
    middle = (np.arange(STRIDE)[:, None, None] + 0.5) / STRIDE
    velocity = y + middle * (y_next - y)
    turned = DT * np.cumsum(velocity[..., 2], axis=0)
    psi = pose[:, 2] + turned - 0.5 * DT * velocity[..., 2]
    u, v = velocity[..., 0], velocity[..., 1]
    moved = np.stack(
        [u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)], axis=-1
    )
    return np.concatenate(
        [pose[:, :2] + DT * np.cumsum(moved, axis=0), (pose[:, 2] + turned)[..., None]], axis=-1
    )


def _measured(like: Predictions, lag: int) -> Array:
    """(S, 6) stroke means of pose and velocity, `lag` grid points before each start but never too early for a mean."""
    out = np.full((len(like.start), 6), np.nan)
    for m, frames in enumerate(like.estimates.experiment.frames):
        which = like.trial == m
        centres = np.maximum((like.start[which] - lag) * DT, frames.t[0] + HALF_WINDOW)
        out[which] = stroke_mean(frames.t, centres)(frames.pose)
    return out


def judge(
    training: Experiment, held_out: Experiment | None, start: Robot, fitted: Robot, noise: Noise
) -> tuple[Predictions, dict[str, ErrorSizes], list[str]]:
    """Predictions, errors of both robots and of the baselines, and what could not be had, on the held-out trials."""
    unseen = held_out or training
    longest = max(HORIZONS)
    judged = predict(unseen, fitted, noise, longest, EVERY, WARM_UP)
    peeking = predict(unseen, fitted, noise, longest, EVERY, WARM_UP, PEEK)
    before = predict(unseen, start, initial_noise(unseen, start, noise), longest, EVERY, WARM_UP)
    errors = {"start": prediction_errors(before), "identified": prediction_errors(judged)}
    try:
        baselines = fit_baselines(training)
    except ValueError as error:
        return judged, errors, [f"no baselines: {error}"]
    for name, advance in baselines.items():
        errors[name] = prediction_errors(predict_baseline(advance, judged, HALF_WINDOW))
    errors["identified" + AHEAD] = prediction_errors(peeking)
    for name, advance in baselines.items():
        errors[name + AHEAD] = prediction_errors(predict_baseline(advance, judged))
    return judged, errors, []
