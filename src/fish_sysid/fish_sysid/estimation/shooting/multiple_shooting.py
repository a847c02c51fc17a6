# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters by multiple shooting: windows of raw measurements with free start states, by damped Gauss-Newton.

    min over theta, sensors, x_w, b_w   sum of rho(e) + 1/2 |(theta, sensors) / prior|^2 + 1/2 sum of |(x_w - x_w0) / spread|^2

rho: Huber's function; e: `residuals`. Bock's multiple shooting (Bock 1983) without the continuity of neighbouring windows: a
model that lacks something cannot follow a whole trial. The start states are eliminated by Schur's complement, so that an
iteration costs one rollout per parameter and start number, whatever the number of windows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.camera import forward
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import Parametrization
from fish_sysid.estimation.shooting.least_squares import Blocks, Reduced, eliminate, huber, weight
from fish_sysid.estimation.shooting.residuals import (
    SENSORS,
    Residuals,
    Scale,
    Windows,
    ahead_in,
    residuals,
)
from fish_sysid.estimation.shooting.rollout import poses_and_slopes, states

Array = NDArray[np.float64]

LARGEST_STEP = 0.5  # of theta and sensors in an iteration
SETTLED = 0.002  # of the cost; an iteration that gains less is the last
RUN_IN = 1.5  # s of swimming from a straight tail, which gives the tail's swing at a window's start
NEAR = 0.35  # s around a window's start whose poses give its first pose and velocity
# of a window's start motion around its first guess: m, m, rad, tail's rad, m/s, m/s, rad/s, tail's rad/s, effects' states
SPREAD = (0.05, 0.05, 0.3, 0.5, 0.3, 0.3, 3.0, 10.0, 1.0)
ZERO_PAST = 4.0  # s before a window in which camera and IMU tell the IMU's zero of heading
ZERO_SPREAD = 0.01  # rad, of that zero around their median difference


@dataclass(frozen=True)
class Guess:
    """Where a fit stands."""

    theta: Array  # (K,)
    sensors: Array  # (4,) SENSORS in units of their scale
    x: Array  # (W, NX) start motions
    zero: Array  # (W,) rad

    @property
    def z(self) -> Array:
        """(K + 4,) what all windows share."""
        return np.concatenate([self.theta, self.sensors])


class Shooting:
    """One hypothesis on the windows of an experiment."""

    def __init__(
        self,
        experiment: Experiment,
        coordinates: Parametrization,
        windows: Windows,
        scale: Scale | None = None,
        prior: Array | None = None,
    ) -> None:
        """prior: (K,) standard deviations of theta; None: those of the coordinates."""
        self.experiment, self.coordinates, self.windows = experiment, coordinates, windows
        self.scale = scale or Scale()
        own = coordinates.prior if prior is None else prior
        self.prior = np.concatenate([own, np.ones(len(SENSORS))])
        self.names = (*coordinates.hypothesis.free, *SENSORS)
        self.nx = len(coordinates.stepper.layout.motion)
        nq = coordinates.stepper.layout.links + 3
        x, y, psi, tail, u, v, r, tail_rate, own_state = SPREAD
        spread = [x, y, psi, *[tail] * (nq - 3), u, v, r, *[tail_rate] * (nq - 3)]
        self.spread = np.array([*spread, *[own_state] * (self.nx - 2 * nq), ZERO_SPREAD])

    def first_guess(self, theta: Array, sensors: Array | None = None) -> Guess:
        """Start motions from the camera's poses and a run-in of the tail; they are the centre of their prior."""
        nq = self.coordinates.stepper.layout.links + 3
        sensors = np.zeros(len(SENSORS)) if sensors is None else sensors
        x = self._run_in(theta)
        pose, rate = self._seen_at_start()
        pose = forward(pose, -ahead_in(sensors))
        x[:, 3:nq] += pose[:, 2:] - x[:, 2:3]
        x[:, :3], x[:, nq : nq + 2] = pose, rate[:, :2]
        self.centre = np.column_stack([x, np.zeros(len(x))])
        zero = self._first_zero()
        self.centre[:, -1] = zero
        return Guess(theta, sensors, x, zero)

    def _seen_at_start(self) -> tuple[Array, Array]:
        """(W, 3) pose and its rate at the windows' starts: a straight line through the frames around them."""
        pose, rate = np.zeros((2, len(self.windows), 3))
        for w, (m, k) in enumerate(zip(self.windows.trial, self.windows.start, strict=True)):
            mine = self.windows.poses.window == w
            t, seen = self.windows.poses.t[mine], self.windows.poses.value[mine]
            frames = self.experiment.frames[m]
            before = (frames.t < k * DT + t[0] - 1e-9) & (frames.t > k * DT - NEAR)
            t = np.concatenate([frames.t[before] - k * DT, t])
            seen = np.concatenate([frames.pose[before], seen])
            near = np.argsort(np.abs(t), kind="stable")[: max(4, int((np.abs(t) < NEAR).sum()))]
            line = np.column_stack([np.ones(len(near)), t[near]])
            pose[w], rate[w] = np.linalg.lstsq(line, seen[near], rcond=None)[0]
        return pose, rate

    def _run_in(self, theta: Array) -> Array:
        """(W, NX) motions at the windows' starts of a fish that swims towards them from a straight tail."""
        p = self.coordinates.filter_inputs(theta)[0]
        stepper, steps = self.coordinates.stepper, round(RUN_IN / DT)
        nq = stepper.layout.links + 3
        rows = np.maximum(self.windows.start + np.arange(-steps, 0)[:, None], 0)
        told = self.experiment.commands[rows, self.windows.trial]
        early = replace(self.windows, start=rows[0], steps=steps, commands=told)
        pose, rate = self._seen_at_start()
        x = np.zeros((len(self.windows), self.nx))
        x[:, 2:nq] = pose[:, 2:]
        x[:, nq : nq + 2] = rate[:, :2]
        end = states(stepper, self.experiment, early, p, x)[-1, :, : self.nx]
        lost = ~np.isfinite(end).all(axis=1) | (np.abs(end[:, nq:]).max(axis=1) > 60.0)
        end[lost] = x[lost]
        return end

    def _first_zero(self) -> Array:
        """(W,) the IMU's zero of heading by what it and the camera say until the window's end and some time before it."""
        zero, span = np.zeros(len(self.windows)), self.windows.steps * DT
        for w, (m, k) in enumerate(zip(self.windows.trial, self.windows.start, strict=True)):
            felt, seen = self.experiment.heading_of(int(m)), self.experiment.frames[m]
            first, last = k * DT - ZERO_PAST, k * DT + span
            near = (felt.t >= max(first, seen.t[0])) & (felt.t <= min(last, seen.t[-1]))
            near &= felt.t <= seen.t[np.searchsorted(seen.t, last, side="right") - 1]
            if near.any():
                line = np.interp(felt.t[near], seen.t, seen.pose[:, 2])
                zero[w] = np.median(felt.psi[near] - line)
        return zero

    def residuals(self, guess: Guess, theta_slopes: bool = True) -> Residuals:
        """With slopes along everything, or along the start states alone."""
        p, dp, _ = self.coordinates.filter_inputs(guess.theta)
        dp = dp if theta_slopes else dp[:0]
        pose, slope = poses_and_slopes(
            self.coordinates.stepper, self.experiment, self.windows, p, dp, guess.x
        )
        return residuals(self.windows, self.scale, pose, slope, len(dp), guess.sensors, guess.zero)

    def errors(self, guess: Guess) -> Residuals:
        """Without slopes."""
        p = self.coordinates.filter_inputs(guess.theta)[0]
        stepper = self.coordinates.stepper
        pose = states(stepper, self.experiment, self.windows, p, guess.x)[..., :3]
        return residuals(self.windows, self.scale, pose, None, 0, guess.sensors, guess.zero)

    def costs(self, guess: Guess, found: Residuals) -> Array:
        """(W,) cost of each window, with its start state's prior, without that of the parameters."""
        cost = np.bincount(found.window, huber(found.e), len(self.windows))
        off = (np.column_stack([guess.x, guess.zero]) - self.centre) / self.spread
        total: Array = cost + 0.5 * np.sum(off**2, axis=1)
        return total

    def total(self, guess: Guess, found: Residuals) -> float:
        """What is made small."""
        return float(self.costs(guess, found).sum() + 0.5 * np.sum((guess.z / self.prior) ** 2))

    def blocks(self, guess: Guess, found: Residuals) -> Blocks:
        """Gauss-Newton matrices by window, without the prior of the parameters."""
        P, X, W = found.Jz.shape[1], self.nx + 1, len(self.windows)
        A, g, B = np.zeros((W, P, P)), np.zeros((W, P)), np.zeros((W, P, X))
        H, h = np.zeros((W, X, X)), np.zeros((W, X))
        order = np.argsort(found.window, kind="stable")
        edges = np.searchsorted(found.window[order], np.arange(W + 1))
        weighted = weight(found.e)
        for w in range(W):
            rows = order[edges[w] : edges[w + 1]]
            Jz, Jx, e, s = found.Jz[rows], found.Jx[rows], found.e[rows], weighted[rows]
            A[w], B[w], H[w] = (Jz.T * s) @ Jz, (Jz.T * s) @ Jx, (Jx.T * s) @ Jx
            g[w], h[w] = Jz.T @ (s * e), Jx.T @ (s * e)
        at = np.arange(X)
        H[:, at, at] += 1.0 / self.spread**2
        h += (np.column_stack([guess.x, guess.zero]) - self.centre) / self.spread**2
        return Blocks(A, g, B, H, h)

    def settle(self, guess: Guess, iterations: int = 4) -> Guess:
        """Start states for the parameters as they are; every window goes its own way."""
        damping = np.full(len(self.windows), 1e-3)
        found = self.residuals(guess, theta_slopes=False)
        best = self.costs(guess, found)
        for _ in range(iterations):
            blocks = self.blocks(guess, found)
            H, at = blocks.H.copy(), np.arange(self.nx + 1)
            H[:, at, at] *= 1.0 + damping[:, None]
            move = -np.linalg.solve(H, blocks.h[:, :, None])[:, :, 0]
            tried = replace(guess, x=guess.x + move[:, :-1], zero=guess.zero + move[:, -1])
            cost = self.costs(tried, self.errors(tried))
            better = cost < best
            if not better.any():
                damping *= 10.0
                continue
            gain = float((best - cost)[better].sum())
            x = np.where(better[:, None], tried.x, guess.x)
            guess = replace(guess, x=x, zero=np.where(better, tried.zero, guess.zero))
            best, damping = (
                np.where(better, cost, best),
                np.where(better, damping / 5.0, damping * 10.0),
            )
            if gain < SETTLED * best.sum():
                break
            found = self.residuals(guess, theta_slopes=False)
        return guess

    def fit(
        self,
        guess: Guess,
        iterations: int = 12,
        settled: float = SETTLED,
        moving: NDArray[np.bool_] | None = None,
    ) -> tuple[float, Guess]:
        """(cost, guess) after damped Gauss-Newton from a guess. moving: (K + 4,) what moves, default everything."""
        moving = np.ones(len(self.prior), dtype=bool) if moving is None else moving
        free = np.flatnonzero(moving)
        damping, best = 1e-2, self.total(guess, self.errors(guess))
        for _ in range(iterations):
            blocks = self.blocks(guess, self.residuals(guess))
            for _ in range(5):
                tried = self._stepped(guess, eliminate(blocks, damping), damping, blocks, free)
                cost = self.total(tried, self.errors(tried))
                if cost < best:
                    break
                damping *= 6.0
            if not cost < best:
                break
            gain, best, guess, damping = best - cost, cost, tried, max(damping / 6.0, 1e-7)
            if gain < settled * best:
                break
        return best, guess

    def _stepped(
        self,
        guess: Guess,
        reduced: Reduced,
        damping: float,
        blocks: Blocks,
        free: NDArray[np.int64],
    ) -> Guess:
        matrix = reduced.matrix.sum(axis=0) + np.diag(1.0 / self.prior**2)
        matrix += damping * np.diag(np.diag(blocks.A.sum(axis=0)) + 1.0 / self.prior**2)
        gradient = reduced.gradient.sum(axis=0) + guess.z / self.prior**2
        dz = np.zeros(len(self.prior))
        dz[free] = -np.linalg.solve(matrix[np.ix_(free, free)], gradient[free])
        dz = np.clip(dz, -LARGEST_STEP, LARGEST_STEP)
        K = len(guess.theta)
        theta = self.coordinates.clip(guess.theta + dz[:K]) if K else guess.theta
        dz[:K] = theta - guess.theta
        move = reduced.start_moves(dz)
        return Guess(
            theta, guess.sensors + dz[K:], guess.x + move[:, :-1], guess.zero + move[:, -1]
        )
