# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters that predict best over seconds, from states that know only what was before.

    min over theta   sum of rho(e) + 1/2 |(theta, sensors) / prior|^2,   e: `stroke_targets` after 0.5 to 5 s

(simulation error minimisation; Farina and Piroddi 2010). Start states come from `start_states` with the parameters as they
are, and are held while Gauss-Newton moves the parameters; then they are found anew. The cost tells optima apart that
windows with free start states do not. The IMU's clock acts on start states alone, so that Gauss-Newton leaves it as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import cores, on_all_cores
from fish_sim.model import DT
from fish_sysid.dataset.camera import forward
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import Parametrization
from fish_sysid.estimation.shooting.least_squares import huber, weight
from fish_sysid.estimation.shooting.residuals import SENSOR_SCALE, SENSORS, Scale
from fish_sysid.estimation.shooting.rollout import STEP
from fish_sysid.estimation.shooting.start_states import PAST, START_TRUST, shot_states
from fish_sysid.prediction.stroke_average import HALF_WINDOW, HORIZONS, targets_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LOST = 30.0  # a scaled error of a prediction that diverged
STEEPEST = 300.0  # slope of an error beyond which the motion is unstable
LARGEST_STEP = 0.5  # of theta and sensors
LANES = 512  # of a rollout; the states of more do not stay in the processor's cache
SHARES = (1.0, 0.3, 0.1)  # of the way to what a round found
SETTLED = 0.002  # of the cost
UPDATES = 2  # steps with slopes that the last step showed


class Multistep:
    """Prediction errors of a hypothesis on an experiment as functions of z = (theta, sensors)."""

    def __init__(
        self,
        experiment: Experiment,
        coordinates: Parametrization,
        starts: Index,
        prior: Array | None = None,
        past: float = PAST,
        trust: Scale = START_TRUST,
    ) -> None:
        """starts: (S, 2) trial and grid point. prior: (K,) standard deviations of theta. trust: of start states in sensors."""
        self.experiment, self.coordinates = experiment, coordinates
        self.past, self.trust = past, trust
        own = coordinates.prior if prior is None else prior
        self.prior = np.concatenate([own, np.ones(len(SENSORS))])
        self.targets = targets_of(experiment, starts)
        used = np.unique(self.targets.start)
        self.starts = starts[used]
        self.targets = replace(self.targets, start=np.searchsorted(used, self.targets.start))

    @property
    def imu_clock(self) -> int:
        """Place in z of the IMU's age beyond the camera's."""
        return len(self.prior) - len(SENSORS) + SENSORS.index("imu_latency.delay")

    def states(self, z: Array) -> Array:
        """(S, NS) start states with z as the camera has them: of its point, at its clock; NaN where none was found.

        So they stay what the camera says when that point or that clock moves.
        """
        K = len(self.prior) - len(SENSORS)
        robot = self.coordinates.robot(z[:K])
        found = shot_states(self.experiment, robot, self.starts, z[K:], self.past, self.trust)
        late, _, _, ahead = z[K:] * SENSOR_SCALE
        return self._carried(self._advanced(found, -late), ahead)

    def _advanced(self, states: Array, seconds: float) -> Array:
        """States (S, NS) whose coordinates go on as fast as they move."""
        nq, out = self.coordinates.stepper.layout.links + 3, states.copy()
        out[:, :nq] += seconds * states[:, nq : 2 * nq]
        return out

    def _carried(self, states: Array, ahead: float) -> Array:
        """States (S, NS) with position and velocity of a point `ahead` [m] of the one that they are of."""
        nq = self.coordinates.stepper.layout.links + 3
        out, psi, r = states.copy(), states[:, 2], states[:, nq + 2]
        out[:, 0] += ahead * np.cos(psi)
        out[:, 1] += ahead * np.sin(psi)
        out[:, nq] -= ahead * r * np.sin(psi)
        out[:, nq + 1] += ahead * r * np.cos(psi)
        return out

    def errors(self, z: Array, states: Array, slopes: bool = False) -> tuple[Array, Array]:
        """Scaled errors (R, 4) and, if asked, slopes (R, 4, K + 4); those without a start state are 0."""
        K = len(z) - len(SENSORS)
        p, dp, _ = self.coordinates.filter_inputs(z[:K])
        late, _, offset, ahead = z[K:] * SENSOR_SCALE
        P, camera = p[None], np.array([[ahead, late]])
        if slopes:  # one lane more for each parameter, the camera's point and its clock
            P = np.concatenate([P, p + STEP * dp, P, P])
            camera = np.repeat(camera, len(P), axis=0)
            camera[-2, 0] += STEP
            camera[-1, 1] += STEP
        pose = self._poses(P, states, camera)
        e = self.targets.errors(pose, late, offset)
        value = self._cleaned(e[:, 0])
        found = np.asarray(np.isfinite(states).all(axis=1))
        missing = ~found[self.targets.start]
        value[missing] = 0.0
        if not slopes:
            return value, np.zeros((*value.shape, 0))
        J = np.zeros((*value.shape, len(z)))
        e[:, -1:] = self.targets.errors(pose[:, :, -1:], late + STEP, offset)
        lanes = ((e[:, 1:] - e[:, :1]) / STEP).transpose(0, 2, 1)
        J[..., :K] = lanes[..., :K]
        J[..., K + 3], J[..., K] = (
            lanes[..., K] * SENSOR_SCALE[3],
            lanes[..., K + 1] * SENSOR_SCALE[0],
        )
        J[:, 2, K + 2] = SENSOR_SCALE[2] / self.targets.scale[:, 2]
        wild = ~np.isfinite(J).all(axis=2) | (np.abs(J) > STEEPEST).any(axis=2)
        J[wild | missing[:, None]] = 0.0
        return value, J

    def _poses(self, P: Array, states: Array, camera: Array) -> Array:
        """(T, S, C, 3) poses of the camera's point from states (S, NS) with parameters (C, NP).

        camera: (C, 2) how far that point lies ahead [m] and how old images are [s].
        """
        T = int(np.ceil((max(HORIZONS) + HALF_WINDOW) / DT)) + 1
        stepper, C = self.coordinates.stepper, len(P)
        m, k = self.starts.T
        rows = np.minimum(k + np.arange(T)[:, None], self.experiment.steps[m] - 1)
        told, known = self.experiment.commands[rows, m], np.nan_to_num(states)
        start = np.stack(
            [self._advanced(self._carried(known, -ahead), late) for ahead, late in camera], axis=1
        )

        def share(own: Index) -> Array:
            lanes = start[own].reshape(len(own) * C, -1)
            moved = stepper.rollout(
                lanes, np.repeat(told[:, own], C, axis=1), np.tile(P, (len(own), 1))
            )
            pose = moved[..., :3].reshape(T + 1, len(own), C, 3)
            with np.errstate(invalid="ignore"):  # of motions that diverged, see `_cleaned`
                return forward(pose, camera[:, 0])

        count = max(2 * cores(), len(start) * C // LANES)
        shares = np.array_split(np.arange(len(start)), max(1, min(count, len(start))))
        return np.concatenate(on_all_cores(share, shares), axis=1)

    def _cleaned(self, e: Array) -> Array:
        return np.clip(np.nan_to_num(e, nan=LOST), -LOST, LOST)

    def total(self, z: Array, e: Array, prior: Array | None = None) -> float:
        """What is made small. prior: (P,) deviations of z; None: those of the hypothesis."""
        prior = self.prior if prior is None else prior
        return float(huber(e).sum() + 0.5 * np.sum((z / prior) ** 2))

    def cost(self, z: Array) -> float:
        """With states of its own."""
        return self.total(z, self.errors(z, self.states(z))[0])

    def costs_by_trial(self, z: Array) -> Array:
        """(M,) mean cost per prediction of each trial, without the prior; NaN for a trial without a target."""
        cost = huber(self.errors(z, self.states(z))[0]).sum(axis=1)
        M = len(self.experiment.names)
        count = np.bincount(self.targets.trial, minlength=M)
        with np.errstate(invalid="ignore"):
            mean: Array = np.bincount(self.targets.trial, cost, M) / count
        return mean

    def clip(self, z: Array) -> Array:
        """Into the physical ranges; an IMU's sample is not younger than its stamp."""
        K, out = len(z) - len(SENSORS), z.copy()
        out[:K] = self.coordinates.clip(z[:K]) if K else z[:K]
        out[self.imu_clock] = max(z[self.imu_clock], -z[K])
        return out

    def minimise(self, z: Array, states: Array, iterations: int) -> Array:
        """Damped Gauss-Newton with the start states as they are: so many times with slopes, and UPDATES steps after each.

        A step after the first takes the slopes that the last step showed (Broyden 1965), at the cost of one rollout.
        """
        damping = 1e-2
        for _ in range(iterations):
            e, J = self.errors(z, states, slopes=True)
            best = before = self.total(z, e)
            for _ in range(1 + UPDATES):
                tried, found, enough = self._step(z, states, e, J, damping)
                cost = self.total(tried, found)
                if not cost < best:
                    break
                moved = tried - z
                J += np.multiply.outer(found - e - J @ moved, moved / (moved @ moved))
                gain, best, z, e = best - cost, cost, tried, found
                damping = max(enough / 5.0, 1e-6)
                if gain < SETTLED * best:
                    break
            if before - best < SETTLED * best:
                break
        return z

    def _step(
        self, z: Array, states: Array, e: Array, J: Array, damping: float
    ) -> tuple[Array, Array, float]:
        """(z, its errors, damping) of the first step that lowers the cost, of a few with more and more damping."""
        best = self.total(z, e)
        gradient, normal = self.normal(z, e, J)
        for _ in range(5):
            damped = normal + damping * np.diag(np.diag(normal))
            step = np.clip(-np.linalg.solve(damped, gradient), -LARGEST_STEP, LARGEST_STEP)
            step[self.imu_clock] = 0.0
            tried = self.clip(z + step)
            found = self.errors(tried, states)[0]
            if self.total(tried, found) < best:
                break
            damping *= 5.0
        return tried, found, damping

    def normal(
        self, z: Array, e: Array, J: Array, prior: Array | None = None
    ) -> tuple[Array, Array]:
        """(gradient (P,), Gauss-Newton matrix (P, P)) of the cost, with deviations prior (P,) of z as `total`."""
        prior = self.prior if prior is None else prior
        flat, rows = e.ravel(), J.reshape(e.size, -1)
        weighted = weight(flat)
        gradient = rows.T @ (weighted * flat) + z / prior**2
        return gradient, (rows.T * weighted) @ rows + np.diag(1.0 / prior**2)

    def improve(self, z: Array, rounds: int = 3, iterations: int = 3) -> tuple[float, Array]:
        """(cost, z): rounds of parameters found with states of z, judged with states of their own."""
        states = self.states(z)
        best = self.total(z, self.errors(z, states)[0])
        for _ in range(rounds):
            before, moved = best, self.minimise(z, states, iterations)
            for share in SHARES:
                tried = self.clip(z + share * (moved - z))
                own = self.states(tried)
                cost = self.total(tried, self.errors(tried, own)[0])
                if cost < best:
                    best, z, states = cost, tried, own
                    break
            if before - best < SETTLED * before:
                break
        return best, z
