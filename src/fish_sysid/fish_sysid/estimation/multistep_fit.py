"""Fit for the outlook: parameters that predict best over seconds, for a model that is known to be wrong.

The likelihood asks how well the next sample is foretold. A model that lacks something needs a strong unexplained force for
that, which then takes in what the parameters should explain: they drift to where the next 50 ms are right and the next 5 s
are not. Here the prediction errors over HORIZONS themselves are made small (simulation error minimisation; Farina and
Piroddi 2010; the robust weights are Huber's):

    min over theta  sum of rho(e),  e = (x / s_p, y / s_p, psi / s_psi, u / s_u) of stroke means after h seconds
                    + 1/2 |theta / prior|^2

from the filter's states at start points every second, by Gauss-Newton with forward sensitivities. The states are estimated
anew with the parameters found, a few times; sensor errors move no fish and keep their values. Standard errors are those of
J' W J / s^2 + diag(1 / prior^2), s^2 the mean of min(e^2, ROBUST^2): what the data do not determine is as unsure as the prior.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import cores, on_all_cores
from fish_sim.model import DT
from fish_sysid.dataset.camera_time_offset import moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import WRENCH, Noise, SensorModel
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.prediction.prediction import (
    CHUNK,
    EVERY,
    WARM_UP,
    estimate,
    start_points,
)
from fish_sysid.prediction.stroke_average import HALF_WINDOW, stroke_mean

Array = NDArray[np.float64]

HORIZONS = (0.5, 1.0, 2.0, 3.5, 5.0)  # s
POSITION = (0.008, 0.02)  # m, and m per s of horizon: what counts as one
HEADING = (0.06, 0.04)  # rad, and rad per s
SPEED = 0.02  # m/s
ROBUST = 3.0  # beyond it an error counts linearly
STEEPEST = (
    300.0  # of an error's derivative; beyond it the motion is unstable and its slope says nothing
)
CALM = 5.0  # times usual water: an unexplained force that leaves slow motion to the parameters
ROUNDS = 4  # of states and parameters
ITERATIONS = 10
LARGEST_STEP = 0.5  # of theta
SMALL_GAIN = 0.5  # of the cost
SHARES = (1.0, 0.3, 0.1)  # of the way to what a round found
SETTLED = 0.01  # of the cost; a round that gains less is the last
LOST = 30.0  # error of a prediction that diverged


@dataclass(frozen=True)
class Target:
    """One stroke mean to be foretold."""

    start: int  # row of the start points
    position: Array  # (F,) grid points after the start, of the frames in the window
    value: Array  # (F,) weights of the mean
    slope: Array  # (F,) 1/s, weights of the rate
    measured: Array  # (4,) x, y [m], psi [rad], u [m/s]
    scale: Array  # (4,)


class MultistepError:
    """Prediction errors of a hypothesis on an experiment as functions of theta."""

    def __init__(
        self,
        experiment: Experiment,
        hypothesis: Hypothesis,
        every: float = EVERY,
        horizons: tuple[float, ...] = HORIZONS,
    ) -> None:
        """every: s between start points; horizons: s."""
        self.coordinates = hypothesis.parametrization
        self.experiment, self.horizons = experiment, horizons
        self.starts = start_points(experiment, every, WARM_UP)
        self.sensors = self.coordinates.filter_inputs(self.coordinates.origin())[2]
        self.moving = np.ones(len(hypothesis.free), dtype=bool)  # the fish: all but sensor errors
        self.moving[list(self.sensors.free.values())] = False
        self.targets = self._targets(self.sensors)

    def _targets(self, sensors: SensorModel) -> dict[int, list[Target]]:
        """What such sensors saw, less their errors, by trial."""
        targets: dict[int, list[Target]] = {}
        seen = moved_back(self.experiment, sensors.camera_latency)
        shown = np.array([sensors.camera_scale, sensors.camera_scale, 1.0])
        for row, (m, k) in enumerate(self.starts.tolist()):
            frames = seen.frames[m]
            truth = (frames.pose - [0.0, 0.0, sensors.camera_heading_offset]) / shown
            found = [
                target
                for h in self.horizons
                if (target := _target(row, frames.t, truth, k, h, int(self.experiment.steps[m])))
            ]
            if found:
                targets.setdefault(m, []).extend(found)
        return targets

    def start_from(self, theta: Array, noise: Noise) -> None:
        """Take the start states from the filter with theta, and what is to be foretold from its sensors."""
        sensors = self.coordinates.filter_inputs(theta)[2]
        if sensors != self.sensors:
            self.sensors, self.targets = sensors, self._targets(sensors)
        robot = self.coordinates.robot(theta)
        plain = {k: v for k, v in robot.effects.items() if k != "disturbance"}
        self.estimates, self.noise = (
            estimate(self.experiment, replace(robot, effects=plain), noise),
            noise,
        )

    def cost(self, theta: Array) -> float:
        """What is made small."""
        return self._cost(self.errors(theta, False)[0], theta)

    def mean_costs(self, theta: Array) -> Array:
        """(M,) cost per prediction of each trial, without the prior; NaN for a trial too short to predict."""
        p, dp, _ = self.coordinates.filter_inputs(theta)
        e = np.clip(np.nan_to_num(self._of_targets(p, dp[:0])[0], nan=LOST), -LOST, LOST)
        cost, trial = (
            _huber(e).sum(1),
            np.repeat(list(self.targets), [len(t) for t in self.targets.values()]),
        )
        return np.array(
            [
                cost[trial == m].mean() if m in self.targets else np.nan
                for m in range(len(self.experiment.names))
            ]
        )

    def _cost(self, e: Array, theta: Array) -> float:
        return float(_huber(e).sum() + 0.5 * np.sum((theta / self.coordinates.prior) ** 2))

    def errors(self, theta: Array, slopes: bool = True) -> tuple[Array, Array]:
        """Scaled errors (R,) and their derivatives (R, K), K = 0 without slopes."""
        p, dp, _ = self.coordinates.filter_inputs(theta)
        e, J = self._of_targets(p, dp if slopes else dp[:0])
        e, J = e.ravel(), J.reshape(e.size, J.shape[2])
        wild = ~np.isfinite(e) | ~np.isfinite(J).all(1) | (np.abs(J) > STEEPEST).any(1)
        return np.clip(np.nan_to_num(e, nan=LOST), -LOST, LOST), np.where(wild[:, None], 0.0, J)

    def minimise(self, theta: Array, iterations: int = ITERATIONS) -> Array:
        """Damped Gauss-Newton from theta, with the start states as they are."""
        damping = 1e-2
        e, J = self.errors(theta)
        best = self._cost(e, theta)
        for _ in range(iterations):
            gradient, normal = self._normal(e, J, theta)
            for _ in range(6):
                damped = normal + damping * np.diag(np.diag(normal))
                move = np.clip(-np.linalg.solve(damped, gradient), -LARGEST_STEP, LARGEST_STEP)
                tried = self._moved(theta, move)
                cost = self.cost(tried)
                if cost < best:
                    break
                damping *= 5.0
            if not cost < best:
                break
            gain, best, theta, damping = best - cost, cost, tried, max(damping / 5.0, 1e-6)
            if gain < SMALL_GAIN:
                break
            e, J = self.errors(theta)
        return theta

    def improve(
        self,
        theta: Array,
        noise: Noise,
        iterations: int = ITERATIONS,
        shares: tuple[float, ...] = SHARES,
    ) -> tuple[float, Array]:
        """(cost, theta) of one round: parameters found with the states of theta, judged with states of their own.

        shares: of the way, tried in turn until one predicts better; theta if none does.
        """
        self.start_from(theta, noise)
        best, moved = self.cost(theta), self.minimise(theta, iterations)
        for share in shares:
            tried = self._moved(theta, share * (moved - theta))
            self.start_from(tried, noise)
            cost = self.cost(tried)
            if cost < best:
                return cost, tried
        return best, theta

    def _moved(self, theta: Array, move: Array) -> Array:
        """Theta a step further within the physical ranges; sensor errors stay to the last bit."""
        return np.where(self.moving, self.coordinates.clip(theta + move), theta)

    def _normal(self, e: Array, J: Array, theta: Array) -> tuple[Array, Array]:
        """(gradient (K,), Gauss-Newton matrix (K, K)) of the cost; a sensor error has no gradient, so that it stays."""
        gradient = J.T @ (_weight(e) * e) + theta / self.coordinates.prior**2
        normal = J.T @ (_weight(e)[:, None] * J) + np.diag(1.0 / self.coordinates.prior**2)
        return np.where(self.moving, gradient, 0.0), normal

    def promised(self, theta: Array) -> float:
        """The cost to which a Gauss-Newton step from theta (K,) would lead, were errors linear: c - g' N^-1 g / 2."""
        e, J = self.errors(theta)
        gradient, normal = self._normal(e, J, theta)
        return self._cost(e, theta) - 0.5 * float(gradient @ np.linalg.solve(normal, gradient))

    def information(self, theta: Array) -> Array:
        """(K, K) whose inverse is the covariance, J' W J / s^2 + diag(1 / prior^2)."""
        e, J = self.errors(theta)
        variance = max(float(np.mean(np.minimum(e**2, ROBUST**2))), 1e-12)
        return J.T @ (_weight(e)[:, None] * J) / variance + np.diag(1.0 / self.coordinates.prior**2)

    def _of_targets(self, p: Array, dp: Array) -> tuple[Array, Array]:
        """Errors (R, 4) and slopes (R, 4, K) of all targets, trial by trial."""
        targets = [target for found in self.targets.values() for target in found]
        rows = sorted({target.start for target in targets})
        shares = np.array_split(self.starts[rows], max(1, min(cores(), len(rows))))
        simulated = on_all_cores(lambda starts: self._simulate(starts, p, dp), shares)
        pose, d_pose = (np.concatenate(parts, axis=1) for parts in zip(*simulated, strict=True))
        column = {row: i for i, row in enumerate(rows)}
        e, J = np.empty((len(targets), 4)), np.empty((len(targets), 4, len(dp)))
        for i, target in enumerate(targets):
            j = column[target.start]
            e[i], J[i] = _error(target, pose[:, j], d_pose[:, j])
        return e, J

    def _simulate(self, starts: NDArray[np.int64], p: Array, dp: Array) -> tuple[Array, Array]:
        """Poses (L + 1, S, 3) and derivatives (L + 1, S, 3, K) from (S, 2) trials and grid points, as `prediction` simulates."""
        S, K, stepper = len(starts), max(len(dp), 1), self.coordinates.stepper
        m, first = starts.T
        length = int(np.ceil((max(self.horizons) + HALF_WINDOW) / DT)) + 1
        at = [stepper.layout.parameters.index(name) for name in WRENCH]
        wrench = np.repeat(
            np.nan_to_num(self.estimates.wrench[first, m]), K, axis=0
        )  # NaN: the filter diverged
        state = np.repeat(self.estimates.state[first, m], K, axis=0)
        k = np.minimum(first + np.arange(length)[:, None], self.experiment.steps[m] - 1)
        commands = self.experiment.commands[k, m]
        P, d_state = np.tile(p, (S * K, 1)), np.zeros_like(state)
        dP = np.tile(dp, (S, 1)) if len(dp) else np.zeros_like(P)
        pose, d_pose = np.empty((length + 1, S * K, 3)), np.zeros((length + 1, S * K, 3))
        pose[0] = state[:, :3]
        for begin in range(0, length, CHUNK):
            end = min(begin + CHUNK, length)
            P[:, at] = wrench * np.exp(-(begin + end) * DT / 2.0 / self.noise.wrench_time)
            told = np.repeat(commands[begin:end], K, axis=1)
            if len(dp):
                still = np.zeros((end - begin, 1, 2))
                x, dx = stepper.rollout_jvp(state, told, P, d_state, still, dP)
                d_pose[begin + 1 : end + 1], d_state = dx[1:, :, :3], dx[-1]
            else:
                x = stepper.rollout(state, told, P)
            pose[begin + 1 : end + 1], state = x[1:, :, :3], x[-1]
        pose = pose.reshape(length + 1, S, K, 3)[:, :, 0]
        return pose, d_pose.reshape(length + 1, S, K, 3).transpose(0, 1, 3, 2)[..., : len(dp)]


def _huber(e: Array) -> Array:
    """Quadratic up to ROBUST, linear beyond."""
    size = np.abs(e)
    return np.where(size < ROBUST, 0.5 * e**2, ROBUST * size - 0.5 * ROBUST**2)


def _weight(e: Array) -> Array:
    """Huber's weights of errors."""
    return np.minimum(1.0, ROBUST / np.maximum(np.abs(e), 1e-9))


def _target(row: int, t: Array, pose: Array, k: int, horizon: float, steps: int) -> Target | None:
    """The stroke mean `horizon` after grid point k; None where the frames do not cover it."""
    centre = k * DT + horizon
    near = np.flatnonzero(np.abs(t - centre) < HALF_WINDOW)
    if len(near) < 2 or t[near[-1]] / DT > steps - 2:
        return None
    mean, position = stroke_mean(t[near], np.array([centre])), t[near] / DT - k
    measured = mean(pose[near])[0, :4]
    if not np.isfinite(measured).all() or position[0] < 0.0:
        return None
    p, psi = (a + b * horizon for a, b in (POSITION, HEADING))
    return Target(
        row, position, mean.value[0], mean.slope[0], measured, np.array([p, p, psi, SPEED])
    )


def _error(target: Target, pose: Array, d_pose: Array) -> tuple[Array, Array]:
    """Scaled error (4,) and slope (4, K) of one target; pose (L + 1, 3), d_pose (L + 1, 3, K) of its prediction."""
    low = target.position.astype(int)
    share = target.position - low
    q = pose[low] + share[:, None] * (pose[low + 1] - pose[low])
    dq = d_pose[low] + share[:, None, None] * (d_pose[low + 1] - d_pose[low])
    mean, rate = target.value @ q, target.slope @ q
    d_mean, d_rate = np.tensordot(target.value, dq, 1), np.tensordot(target.slope, dq, 1)
    cos, sin = np.cos(mean[2]), np.sin(mean[2])
    u, v = rate[0] * cos + rate[1] * sin, rate[1] * cos - rate[0] * sin
    e = np.append(mean, u) - target.measured
    e[2] = (e[2] + np.pi) % (2.0 * np.pi) - np.pi
    d_u = d_rate[0] * cos + d_rate[1] * sin + v * d_mean[2]
    return e / target.scale, np.concatenate([d_mean, d_u[None]]) / target.scale[:, None]


def fit_multistep(
    fit: Fit, experiment: Experiment, report: Callable[[str], None] = lambda _: None
) -> Fit:
    """The fit that predicts best over seconds, from a fit's values or its hypothesis's start values: both go one round.

    The states come from its noise, or one with a calm unexplained force, whichever predicts better. Sensor errors keep the
    values and the covariance that they have in the fit.
    """
    outlook = MultistepError(experiment, fit.hypothesis)
    if not outlook.targets:
        return fit
    usual = Noise()
    x, y, n = usual.wrench
    calm = replace(fit.noise, wrench=(CALM * x, CALM * y, CALM * n), wrench_time=usual.wrench_time)
    noises = (fit.noise, calm)

    def judged(theta: Array, noise: Noise) -> float:
        outlook.start_from(theta, noise)
        return outlook.cost(theta)

    def better_noise(theta: Array) -> tuple[float, Array, Noise]:
        return min(
            ((judged(theta, noise), theta, noise) for noise in noises), key=lambda found: found[0]
        )

    def one_round(theta: Array, noise: Noise) -> tuple[float, Array, Noise]:
        return *outlook.improve(theta, noise, shares=(1.0,)), noise

    report("fitting the outlook from two starts")
    starts = (np.where(outlook.moving, outlook.coordinates.origin(), fit.theta), fit.theta)
    best, theta, noise = min(
        (one_round(*better_noise(t)[1:]) for t in starts), key=lambda found: found[0]
    )
    for i in range(1, ROUNDS):
        report(f"fitting the outlook, round {i + 1} of {ROUNDS}, cost {best:.0f}")
        before = best
        best, theta, noise = one_round(theta, noise)
        if before - best < SETTLED * before:
            break
    best, theta, noise = better_noise(theta)
    outlook.start_from(theta, noise)
    information, kept = outlook.information(theta), np.ix_(~outlook.moving, ~outlook.moving)
    information[kept] = np.linalg.inv(fit.covariance[kept])
    return replace(evaluate(fit.hypothesis, theta, experiment, noise), information=information)
