"""What a physics model has to beat: three predictors that know nothing of the fish's mechanics.

    constant    speed and yaw rate stay as they are
    arx         linear: y_k = A1 y_k-1 + A2 y_k-2 + B1 w_k + B2 w_k-1 + c, y = (u, v, r), w = (sqrt(throttle), alpha)
    bilinear    u' = a0 + a1 u + a2 sqrt(throttle),  r = b0 + b1 alpha u,  v = c r: six numbers

fitted to stroke means of the training trials by least squares. All start from the same filter's estimates as the
physics model: position at the start, heading, speeds and yaw rate averaged over the last stroke.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_train.identify.experiment import Experiment
from fish_train.identify.motion import HALF_WINDOW, stroke_mean
from fish_train.identify.prediction import Estimates, Predictions

Array = NDArray[np.float64]

FULL_ACCELERATION = 12.0 * (4.0 * np.pi) ** 2  # rad/s^2, of the rotor at full throttle: 12 rad at 2 Hz
STROKE = 0.5  # s
STEP = 0.25  # s, period of the baselines
STRIDE = round(STEP / DT)
RIDGE = 1e-6  # of each regressor's mean square: keeps constant commands solvable


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
    return np.stack([np.sqrt(2.0 * power) / FULL_ACCELERATION, _smooth(rudder, experiment)], axis=-1)


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
        raise ValueError(f"{len(A)} rows of stroke means for {A.shape[1]} numbers: the training trials are too short")
    ridge = RIDGE * np.diag(np.sum(A**2, axis=0) + 1e-12)
    return np.linalg.solve(A.T @ A + ridge, A.T @ b)


Advance = Callable[[Array, Array, Array, Array], Array]  # (y_k, y_k-1, w_k+1, w_k), each (S, .) -> y_k+1 (S, 3)


def constant() -> Advance:
    """Speed and yaw rate stay."""
    return lambda y, y_before, w, w_before: y


def fit_arx(data: list[Table]) -> Advance:
    """Second-order linear model."""
    rows = [np.column_stack([d.y[1:-1], d.y[:-2], d.w[2:], d.w[1:-1], np.ones(len(d.y) - 2)]) for d in data]
    theta = _solve(rows, [d.y[2:] for d in data])
    return lambda y, y_before, w, w_before: np.column_stack([y, y_before, w, w_before, np.ones(len(y))]) @ theta


def fit_bilinear(data: list[Table]) -> Advance:
    """Surge acceleration from speed and sqrt(throttle), yaw rate from alpha times speed, sway in proportion to it."""
    mean = [0.5 * (np.column_stack([d.y[1:, 0], d.w[1:, 0]]) + np.column_stack([d.y[:-1, 0], d.w[:-1, 0]])) for d in data]
    a = _solve([np.column_stack([np.ones(len(x)), x]) for x in mean], [np.diff(d.y[:, 0]) / STEP for d in data])
    turn = [np.column_stack([np.ones(len(d.y)), d.w[:, 1] * d.y[:, 0]]) for d in data]
    b = _solve(turn, [d.y[:, 2] for d in data])
    c = _solve([d.y[:, 2:] for d in data], [d.y[:, 1] for d in data])

    def advance(y: Array, y_before: Array, w: Array, w_before: Array) -> Array:
        throttle = 0.5 * (w + w_before)[:, 0]
        u = y[:, 0] + STEP * (a[0] + a[1] * y[:, 0] + a[2] * throttle)
        r = b[0] + b[1] * w[:, 1] * u
        return np.column_stack([u, c[0] * r, r])

    return advance


def fit_baselines(training: Experiment) -> dict[str, Advance]:
    """The three baselines by name; raises ValueError when the training trials are too short."""
    data = [t for t in tables(training) if len(t.y) > 2]
    if not data:
        raise ValueError("no training trial is long enough for the baselines")
    return {"constant": constant(), "arx": fit_arx(data), "bilinear": fit_bilinear(data)}


def predict_baseline(advance: Advance, like: Predictions) -> Predictions:
    """The baseline's predictions from the start points of `like`."""
    experiment, length = like.estimates.experiment, len(like.pose) - 1
    w = inputs(experiment)
    y, y_before = _mean_velocity(like, 0), _mean_velocity(like, STRIDE)
    heading = _mean_heading(like) + 0.5 * STROKE * y[:, 2]
    pose = np.empty_like(like.pose)
    pose[0] = np.column_stack([like.pose[0, :, :2], heading])
    for begin in range(0, length, STRIDE):
        now, then = (w[np.minimum(like.start + k, experiment.length - 1), like.trial] for k in (begin, begin + STRIDE))
        y, y_before = advance(y, y_before, then, now), y
        count = min(STRIDE, length - begin)
        pose[begin + 1 : begin + count + 1] = _travel(pose[begin], y_before, y)[:count]
    pose[np.isnan(like.pose)] = np.nan
    return replace(like, pose=pose)


def _travel(pose: Array, y: Array, y_next: Array) -> Array:
    """(STRIDE, S, 3) poses every 10 ms from pose (S, 3) with velocities that go from y to y_next linearly."""
    middle = (np.arange(STRIDE)[:, None, None] + 0.5) / STRIDE
    velocity = y + middle * (y_next - y)
    turned = DT * np.cumsum(velocity[..., 2], axis=0)
    psi = pose[:, 2] + turned - 0.5 * DT * velocity[..., 2]
    u, v = velocity[..., 0], velocity[..., 1]
    moved = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)], axis=-1)
    return np.concatenate([pose[:, :2] + DT * np.cumsum(moved, axis=0), (pose[:, 2] + turned)[..., None]], axis=-1)


def _last_stroke(like: Predictions, values: Array, lag: int) -> Array:
    """(S, ...) mean of values (T, M, ...) over the stroke that ends `lag` grid points before each start."""
    back = lag + np.arange(round(STROKE / DT))[:, None]
    return values[np.maximum(like.start - back, 0), like.trial].mean(0)


def _mean_velocity(like: Predictions, lag: int) -> Array:
    return _last_stroke(like, like.estimates.velocity, lag)


def _mean_heading(like: Predictions) -> Array:
    return _last_stroke(like, like.estimates.pose[..., 2], 0)
