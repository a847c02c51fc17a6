# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Predict recordings: from the filter's estimate at a moment, the fish is simulated forward with the recorded inputs.

The estimate uses what was measured up to that moment only (an image belongs to the moment it was taken). All start
points of all trials are simulated side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper
from fish_sysid.dataset.camera import ahead_of, at_centre_of_mass, forward
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_base_link
from fish_sysid.dataset.imu import imu_moved_back
from fish_sysid.estimation.ekf import run_filter
from fish_sysid.estimation.ekf_types import WRENCH, Noise, SensorModel
from fish_sysid.estimation.parametrization import nominal_hypothesis, sensor_model
from fish_sysid.estimation.shooting.start_states import shot_states, without_sensor_errors
from fish_sysid.estimation.smoother import smoothed
from fish_sysid.prediction.kept_noise import kept_trust, uses_shooting
from fish_sysid.prediction.stroke_average import HALF_WINDOW, stroke_mean

Array = NDArray[np.float64]

HORIZONS = (1.0, 2.0, 5.0)  # s, at which errors are stated
WARM_UP = 2.0  # s, until the filter has settled; no start point for errors before it
EVERY = 1.0  # s, between start points for errors
TRIALS_AT_ONCE = 4  # in the filter, whose history is large
SHORTEST_PIECE = 10  # steps until a filter that diverged at once is begun anew
LONGEST = 600.0  # s, a horizon; all steps of all predictions are held in memory
CHUNK = 10  # steps with a constant wrench, while it decays


@dataclass(frozen=True)
class Estimates:
    """The filter's causal estimates of an experiment, on its grid."""

    experiment: Experiment
    state: Array  # (T, M, NS) state of the stepper
    wrench: Array  # (T, M, 3) unexplained force on the head [N, N, N m]
    velocity: Array  # (T, M, 3) u, v [m/s], r [rad/s]
    bias: Array  # (M, 3) of gyro [rad/s] and accelerometer forward, left [m/s^2], at the end of each trial
    bias_std: Array  # (M, 3)

    @property
    def pose(self) -> Array:
        """(T, M, 3) x, y [m], heading [rad]."""
        return self.state[..., :3]


@dataclass(frozen=True)
class Predictions:
    """S predictions, each from one start point of one trial; NaN beyond the end of its trial."""

    estimates: Estimates
    sensors: SensorModel
    trial: NDArray[np.int64]  # (S,) index into the experiment's trials
    start: NDArray[np.int64]  # (S,) grid point
    pose: Array  # (L + 1, S, 3) true pose from the start on, every 10 ms
    horizon: float  # s
    ahead: float = 0.0  # m, of the point that the camera follows

    def seen(self, m: int) -> Array:
        """(F, S_m, 3) what the camera should show at the frames of trial m: estimates before the start, then prediction."""
        frames, which = self.estimates.experiment.frames[m], np.flatnonzero(self.trial == m)
        position = (frames.t - self.sensors.camera_latency) / DT
        before = _interpolate(self.estimates.pose[:, m, None], position[:, None])
        after = _interpolate(self.pose[:, which], position[:, None] - self.start[which])
        pose = np.where((position[:, None] < self.start[which])[..., None], before, after)
        pose = forward(pose, self.ahead)
        scale = self.sensors.camera_scale
        shown: Array = pose * np.array([scale, scale, 1.0]) + np.array(
            [0.0, 0.0, self.sensors.camera_heading_offset]
        )
        return shown


@dataclass(frozen=True)
class ErrorSizes:
    """Root mean squares of (position [m], heading [rad], speed [m/s]) per horizon: stroke means, see `motion`."""

    horizons: tuple[float, ...]
    rms: Array  # (H, 3) over all predictions of all trials; NaN where no trial is long enough
    squares: Array  # (M, H, 3) sums of squares per trial
    counts: NDArray[np.int64]  # (M, H)

    def as_table(self) -> dict[str, dict[str, float]]:
        """{"1": {"position": .., "heading": .., "speed": .., "count": ..}, ..}; horizons without data are left out."""
        count = self.counts.sum(0)
        return {
            f"{h:g}": {
                **dict(zip(("position", "heading", "speed"), self.rms[i].tolist(), strict=True)),
                "count": int(count[i]),
            }
            for i, h in enumerate(self.horizons)
            if count[i]
        }


def estimate(experiment: Experiment, robot: Robot, noise: Noise) -> Estimates:
    """Filter all trials with the robot's model, its effects and sensor errors.

    A filter that diverges begins anew from the next image, as often as it has to, without gates: they would keep out
    what puts a wrong start right.
    """
    coordinates = nominal_hypothesis(robot, free=()).parametrization
    p, dp, sensors = coordinates.filter_inputs(np.zeros(0))
    stepper, nx = coordinates.stepper, len(coordinates.stepper.layout.motion)
    given, experiment = experiment, at_centre_of_mass(experiment, ahead_of(robot))
    T, M = experiment.length, len(experiment.names)
    state, wrench = np.full((T, M, len(stepper.layout.state)), np.nan), np.full((T, M, 3), np.nan)
    bias, bias_std = np.zeros((M, 3)), np.zeros((M, 3))

    def fill(chosen: Experiment, part: list[int], begin: int, noise: Noise) -> NDArray[np.bool_]:
        """Results of trials `part` from grid point `begin` on; (steps, trials) where the filter is lost."""
        history = run_filter(chosen, stepper, p, dp, sensors, noise, keep=True).history
        assert history is not None
        end = begin + chosen.length
        state[begin:end, part, :nx] = history.filtered[..., :nx]
        state[begin:end, part, nx:] = history.memory[: chosen.length]
        wrench[begin:end, part] = history.filtered[..., nx : nx + 3]
        last = (chosen.steps - 1, np.arange(len(part)))
        bias[part] = history.filtered[last][:, nx + 3 :]
        bias_std[part] = np.sqrt(
            np.diagonal(history.filtered_P[last], axis1=1, axis2=2)[:, nx + 3 :]
        )
        within = np.arange(chosen.length)[:, None] < chosen.steps
        return within & ~np.isfinite(history.filtered).all(axis=2)

    for first in range(0, M, TRIALS_AT_ONCE):
        part = list(range(first, min(first + TRIALS_AT_ONCE, M)))
        lost = fill(experiment.select(part), part, 0, noise)
        for m, column in zip(part, lost.T, strict=True):
            begin = 0
            while column.any():
                begin += max(int(np.argmax(column)), SHORTEST_PIECE)
                if begin >= experiment.steps[m] or not len(
                    (rest := experiment.rest_of(m, begin)).frames[0].t
                ):
                    break
                column = fill(rest, [m], begin, noise.ungated())[:, 0]
    beyond = np.arange(T)[:, None] >= experiment.steps
    state[beyond], wrench[beyond] = np.nan, np.nan
    return Estimates(
        given, state, wrench, body_velocity(state, stepper.layout.links), bias, bias_std
    )


def body_velocity(state: Array, links: int) -> Array:
    """(..., 3) surge, sway [m/s], yaw rate [rad/s] in base_link of states (..., NS)."""
    x, y, r = (state[..., 3 + links + i] for i in range(3))
    return np.stack([*in_base_link(x, y, state[..., 2]), r], axis=-1)


def predict(
    experiment: Experiment,
    robot: Robot,
    noise: Noise,
    horizon: float,
    every: float | None = None,
    first: float = 0.0,
    ahead: float = 0.0,
) -> Predictions:
    """Predictions over `horizon` [s] from start points every `every` (default: horizon), the first at `first` [s].

    The robot is the whole model: its effects and sensor errors count. The wrench of the estimate dies away with the
    noise's time constant. ahead: s of measurements after each start point that its state may know; 0: a prediction in
    earnest. Raises ValueError when horizon or every is shorter than the grid, or the horizon longer than LONGEST.
    """
    every = horizon if every is None else every
    if not (DT <= horizon <= LONGEST and every >= DT):
        raise ValueError(
            f"horizon {horizon} s, start points every {every} s: expected {DT} to {LONGEST:g} s"
        )
    experiment = imu_moved_back(experiment, robot.sensors.get("imu_latency", {}).get("delay", 0.0))
    estimates, ahead_m = estimate(experiment, robot, noise), ahead_of(robot)
    starts = start_points(experiment, every, first)
    trial, start = starts[:, 0], starts[:, 1]
    length = int(np.ceil((horizon + HALF_WINDOW) / DT)) + 1
    state, wrench = estimates.state[start, trial], estimates.wrench[start, trial]
    if ahead and len(starts):
        nx = len(nominal_hypothesis(robot, free=()).parametrization.stepper.layout.motion)
        centred = at_centre_of_mass(experiment, ahead_m)
        known = smoothed(centred, robot, noise, starts, ahead)
        good = np.isfinite(known).all(axis=1)
        state[good, :nx], wrench[good] = known[good, :nx], known[good, nx : nx + 3]
    if uses_shooting(robot) and len(starts):
        seen = at_centre_of_mass(without_sensor_errors(experiment, robot), ahead_m)
        shot = shot_states(seen, robot, starts, trust=kept_trust(robot), ahead=ahead)
        good = np.isfinite(shot).all(axis=1)
        state[good], wrench[good] = shot[good], 0.0
    pose = _simulate(experiment, robot, noise, starts, state, wrench, length)
    return Predictions(estimates, sensor_model(robot), trial, start, pose, horizon, ahead_m)


def start_points(experiment: Experiment, every: float, first: float) -> NDArray[np.int64]:
    """(S, 2) trial and grid point, from `first` on every `every` seconds while the trial lasts."""
    rows = [
        (m, k)
        for m, steps in enumerate(experiment.steps.tolist())
        for k in np.round(np.arange(first, (steps - 1) * DT, every) / DT).astype(int).tolist()
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def _simulate(
    experiment: Experiment,
    robot: Robot,
    noise: Noise,
    starts: NDArray[np.int64],
    state: Array,
    wrench: Array,
    length: int,
) -> Array:
    """(length + 1, S, 3) poses from state (S, NS) at the start points, NaN beyond the end of the trial.

    NaN throughout where the state is: the filter is lost there for good, and nothing can be predicted.
    """
    trial, start = starts.T
    # the simulator takes finite parameters only; the state tells where the filter is lost
    wrench = np.nan_to_num(wrench)
    stepper = Stepper.of(nominal_hypothesis(robot).robot)
    p = np.tile(stepper.parameters(nominal_hypothesis(robot).robot), (len(trial), 1))
    at = [stepper.layout.parameters.index(name) for name in WRENCH]
    pose = np.full((length + 1, len(trial), 3), np.nan)
    k = start + np.arange(length + 1)[:, None]
    commands = experiment.commands[np.minimum(k[:-1], experiment.length - 1), trial]
    pose[0] = state[:, :3]
    for begin in range(0, length, CHUNK):
        end = min(begin + CHUNK, length)
        p[:, at] = wrench * np.exp(-(begin + end) * DT / 2.0 / noise.wrench_time)
        states = stepper.rollout(state, commands[begin:end], p)
        pose[begin + 1 : end + 1], state = states[1:, :, :3], states[-1]
    pose[k >= experiment.steps[trial]] = np.nan
    return pose


def _interpolate(values: Array, position: Array) -> Array:
    """Rows of values (T, B, 3) at fractional positions (F, B): (F, B, 3); NaN outside."""
    T, columns = len(values), np.arange(values.shape[1])
    inside = (position >= 0.0) & (position <= T - 1)
    low = np.clip(np.floor(position).astype(int), 0, max(T - 2, 0))
    high = np.minimum(low + 1, T - 1)
    share = (np.clip(position, 0.0, T - 1) - low)[..., None]
    below, above = values[low, columns], values[high, columns]
    mixed = np.where(share > 0.0, below + share * (above - below), below)
    return np.where(inside[..., None], mixed, np.nan)


def prediction_errors(predictions: Predictions, horizons: Sequence[float] = HORIZONS) -> ErrorSizes:
    """Errors of stroke means of position, heading and surge speed at the horizons that the predictions reach.

    Horizons count from the start to the moment an image was taken, not to its stamp.
    """
    experiment = predictions.estimates.experiment
    reached = tuple(h for h in horizons if h <= predictions.horizon + 1e-9)
    M, H = len(experiment.names), len(reached)
    squares, counts = np.zeros((M, H, 3)), np.zeros((M, H), dtype=np.int64)
    for m, frames in enumerate(experiment.frames):
        starts, seen = predictions.start[predictions.trial == m] * DT, predictions.seen(m)
        for i, h in enumerate(reached):
            taken = frames.t - predictions.sensors.camera_latency
            squares[m, i], counts[m, i] = _squares(taken, frames.pose, seen, starts + h)
    with np.errstate(invalid="ignore"):
        rms = np.sqrt(squares.sum(0) / counts.sum(0)[:, None])
    return ErrorSizes(reached, rms, squares, counts)


def _squares(t: Array, measured: Array, seen: Array, centres: Array) -> tuple[Array, int]:
    """Sum of squared errors (3,) and number of centres (S,) where both stroke means exist; seen (F, S, 3)."""
    total, count = np.zeros(3), 0
    for s, centre in enumerate(centres):
        near = np.abs(t - centre) < HALF_WINDOW
        if not near.any() or not np.isfinite(seen[near, s]).all():
            continue
        mean = stroke_mean(t[near], np.array([centre]))
        error = mean(seen[near, s])[0] - mean(measured[near])[0]
        speed = mean(seen[near, s])[0, 3] - mean(measured[near])[0, 3]
        heading = (error[2] + np.pi) % (2.0 * np.pi) - np.pi
        row = np.array([np.hypot(error[0], error[1]), heading, speed])
        if np.isfinite(row).all():
            total, count = total + row**2, count + 1
    return total, count
