# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The filter's pass in NumPy, all trials at once: what the compiled pass is compared with, and runs without a compiler."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.estimation.ekf_numpy_steps import Sums, between, empty_history, flow, update
from fish_sysid.estimation.ekf_types import (
    ENCODER_ROW,
    WRENCH,
    Array,
    FilterResult,
    Noise,
    Problem,
    drive_at,
    encoder_terms,
    first_commands,
    first_state,
    follow_commands,
    place_frames,
)


class Filter:
    """One pass over an experiment for given parameters."""

    def __init__(self, problem: Problem, noise: Noise) -> None:
        self.problem = problem
        self.experiment, self.stepper, self.sensors = (
            problem.experiment,
            problem.stepper,
            problem.sensors,
        )
        self.p, self.dp, self.noise = problem.p, problem.dp, noise
        layout = self.stepper.layout
        self.trials, self.free = len(self.experiment.names), len(self.dp)
        self.nq, self.nx, self.n = layout.links + 3, len(layout.motion), len(layout.motion) + 6
        self.wrench_at = [layout.parameters.index(name) for name in WRENCH]
        self.directions = self.nx + 3 + self.free
        self.frames = place_frames(self.experiment, self.sensors)
        self.memory, self.d_memory = follow_commands(
            problem, first_commands(self.experiment), self.experiment.commands
        )

    def run(self, keep: bool = False) -> FilterResult:
        """Filter all trials; keep=True stores the history for the smoother.

        A trial whose state is not finite any more is lost: it takes no further part, its log likelihood is -inf.
        """
        T, M, K, n = self.experiment.length, self.trials, self.free, self.n
        start, start_P = first_state(self.experiment, self.stepper.layout, self.sensors, self.noise)
        xi, P = start, start_P
        D = np.zeros((M, n, K))  # of motion, wrench and biases; that of the memory is self.d_memory
        sums, lost = Sums(M, K, T), np.zeros(M, dtype=bool)
        history = empty_history(T, M, n, self.memory) if keep else None
        decay = np.exp(-DT / self.noise.wrench_time)
        Q = np.zeros((n, n))
        wrench = slice(self.nx, self.nx + 3)
        Q[wrench, wrench] = np.diag(np.square(self.noise.wrench) * (1.0 - decay**2))
        # keeps the covariance regular on the constraint
        Q[range(2 * self.nq), range(2 * self.nq)] = 1e-14
        for k in range(T):
            if history is not None:
                history.predicted[k], history.predicted_P[k] = xi, P
            active = (k < self.experiment.steps) & ~lost
            xi, P, D = self._measure(k, xi, P, D, active, sums)
            if history is not None:
                history.filtered[k], history.filtered_P[k] = np.where(lost[:, None], np.nan, xi), P
            if k == T - 1:
                break
            xi, F, D = self._predict(k, xi, D, decay)
            P = F @ P @ F.transpose(0, 2, 1) + Q
            P = 0.5 * (P + P.transpose(0, 2, 1))
            gone = ~np.isfinite(xi).all(axis=1) | ~np.isfinite(P).all(axis=(1, 2))
            lost |= gone & (k + 1 < self.experiment.steps)
            # of such a trial nothing is used from here on, but numbers have to stand beside those of the others
            xi[gone], P[gone], D[gone] = start[gone], start_P[gone], 0.0
            if history is not None:
                history.transition[k] = F
        self._encoder(sums)
        sums.log_likelihood[lost] = -np.inf
        return FilterResult(
            sums.log_likelihood, sums.samples, sums.gradient, sums.normal, sums.whitened, history
        )

    def _directions(self, D: Array, moving: bool) -> tuple[Array, Array]:
        """Tangent directions (M, directions, nx) of the motion and (M, directions, NP) of the parameters.

        moving False: of the free parameters' directions only what they do to a given motion.
        """
        M, nx = self.trials, self.nx
        ds = np.zeros((M, self.directions, nx))
        ds[:, range(nx), range(nx)] = 1.0
        if moving:
            ds[:, nx + 3 :] = D[:, :nx].transpose(0, 2, 1)
        dp = np.zeros((M, self.directions, len(self.p)))
        dp[:, range(nx, nx + 3), self.wrench_at] = 1.0
        dp[:, nx + 3 :] = self.dp
        dp[:, nx + 3 :, self.wrench_at] = D[:, nx : nx + 3].transpose(0, 2, 1)
        return ds, dp

    def _parameters(self, xi: Array) -> Array:
        p = np.tile(self.p, (self.trials, 1))
        p[:, self.wrench_at] = xi[:, self.nx : self.nx + 3]
        return p

    def _predict(self, k: int, xi: Array, D: Array, decay: float) -> tuple[Array, Array, Array]:
        """One step of 10 ms: (xi, F, D). The estimate takes the simulator's step.

        Its tangents follow x' = A x + b, the Jacobian A taken in the middle of the step and the parameters' b in the middle
        of each half: a few rates with tangents instead of one at every stage of the integrator.
        """
        M, nx, n, columns = self.trials, self.nx, self.n, self.nx + 3
        start = np.concatenate([xi[:, :nx], self.memory[k]], axis=1)
        end = self.stepper.rollout(start, self.experiment.commands[k][None], self._parameters(xi))[
            1
        ]
        ends = [self._rates(k, x[:, :nx], xi, D, c)[0] for x, c in ((start, 0.0), (end, 1.0))]

        def own(fraction: float) -> Array:
            motion = between(start[:, :nx], end[:, :nx], ends[0], ends[1], fraction)
            tangent = self._rates(k, motion, xi, D, fraction, moving=False)[1]
            return tangent.transpose(0, 2, 1)

        A = own(0.5)
        moving = np.zeros((M, nx, self.directions))
        moving[:, range(nx), range(nx)] = 1.0
        moving[:, :, columns:] = D[:, :nx]
        for half in range(2):
            b = own(0.25 + 0.5 * half)
            b[:, :, :nx], b[:, :, nx:columns] = 0.0, A[:, :, nx:columns]
            for _ in range(self.stepper.scheme.substeps):
                moving = flow(A[:, :, :nx], b, 0.5 * DT / self.stepper.scheme.substeps, moving)
        moved = xi.copy()
        moved[:, :nx] = end[:, :nx]
        moved[:, nx:columns] *= decay
        F = np.tile(np.eye(n), (M, 1, 1))
        F[:, :nx, :columns] = moving[:, :, :columns]
        F[:, range(nx, columns), range(nx, columns)] = decay
        D = D.copy()
        D[:, :nx] = moving[:, :, columns:]
        D[:, nx:columns] *= decay
        return moved, F, D

    def _measure(
        self, k: int, xi: Array, P: Array, D: Array, active: NDArray[np.bool_], sums: Sums
    ) -> tuple[Array, Array, Array]:
        """Take in IMU and camera of one grid point: (xi, P, D)."""
        offset, pose = self.frames[0][k], self.frames[1][k]
        z_imu = np.column_stack([self.experiment.gyro[k], self.experiment.accel[k]])
        imu, camera = active & np.isfinite(z_imu).all(1), active & np.isfinite(offset)
        if not imu.any() and not camera.any():
            return xi, P, D
        rate, tangent = self._rates(k, xi[:, : self.nx], xi, D, 0.0)
        if imu.any():
            h, H, dh = self._imu(xi, rate, tangent, D)
            R = np.diag([self.noise.gyro**2, self.noise.accel**2, self.noise.accel**2])
            xi, P, D = update(
                k, slice(0, 3), z_imu - h, H, dh, R, imu, self.noise.gate_imu, (xi, P, D), sums
            )
        if camera.any():
            h, H, dh = self._camera(xi, np.nan_to_num(offset), rate, D)
            position, heading = self.noise.camera_position, self.noise.camera_heading
            R = np.diag([position**2, position**2, heading**2])
            e = pose - h
            e[:, 2] = (e[:, 2] + np.pi) % (2 * np.pi) - np.pi
            xi, P, D = update(
                k, slice(3, 6), e, H, dh, R, camera, self.noise.gate_camera, (xi, P, D), sums
            )
        return xi, P, D

    def _rates(
        self, k: int, motion: Array, xi: Array, D: Array, fraction: float, moving: bool = True
    ) -> tuple[Array, Array]:
        """Rates (M, nx) of a motion at a fraction of the period after grid point k, and their tangents (M, directions, nx)."""
        M, nx, R = self.trials, self.nx, self.directions
        ds, dp = self._directions(D, moving)
        drive = drive_at(self.memory[k, :, :2], self.memory[k + 1, :, :2], fraction)
        d_drive = np.zeros((M, R, 4))
        before, after = self.d_memory[k : k + 2, ..., :2]
        d_drive[:, nx + 3 :] = drive_at(before, after, fraction)
        rate, tangent = self.stepper.rates_jvp(
            np.repeat(motion, R, axis=0),
            np.repeat(drive, R, axis=0),
            np.repeat(self._parameters(xi), R, axis=0),
            ds.reshape(M * R, nx),
            d_drive.reshape(M * R, 4),
            dp.reshape(M * R, -1),
        )
        return rate.reshape(M, R, nx)[:, 0], tangent.reshape(M, R, nx)

    def _imu(self, xi: Array, rate: Array, tangent: Array, D: Array) -> tuple[Array, Array, Array]:
        """Predicted gyro and accelerometer (M, 3), their Jacobian (M, 3, n) and derivatives (M, 3, K)."""
        M, nq, nx, s = self.trials, self.nq, self.nx, self.sensors
        axis = xi[:, 2] + s.imu_misalignment
        cos, sin = np.cos(axis), np.sin(axis)
        ax, ay = rate[:, nq], rate[:, nq + 1]
        forward, left = ax * cos + ay * sin, ay * cos - ax * sin
        h = np.stack([s.gyro_scale * xi[:, nq + 2], forward, left], axis=1) + xi[:, nx + 3 :]
        t_x, t_y = tangent[:, :, nq], tangent[:, :, nq + 1]
        # change of heading along each direction
        turn = np.concatenate([np.zeros((M, nx + 3)), D[:, 2]], axis=1)
        turn[:, 2] = 1.0
        spin = np.concatenate([np.zeros((M, nx + 3)), D[:, nq + 2]], axis=1)
        spin[:, nq + 2] = 1.0
        d = np.stack(
            [
                s.gyro_scale * spin,
                t_x * cos[:, None] + t_y * sin[:, None] + left[:, None] * turn,
                t_y * cos[:, None] - t_x * sin[:, None] - forward[:, None] * turn,
            ],
            axis=1,
        )
        H = np.concatenate([d[:, :, : nx + 3], np.tile(np.eye(3), (M, 1, 1))], axis=2)
        dh = d[:, :, nx + 3 :] + D[:, nx + 3 :]
        if "gyro_scale" in s.free:
            dh[:, 0, s.free["gyro_scale"]] += s.slope.get("gyro_scale", 1.0) * xi[:, nq + 2]
        if "imu_misalignment" in s.free:
            dh[:, 1, s.free["imu_misalignment"]] += s.slope.get("imu_misalignment", 1.0) * left
            dh[:, 2, s.free["imu_misalignment"]] -= s.slope.get("imu_misalignment", 1.0) * forward
        return h, H, dh

    def _camera(
        self, xi: Array, offset: Array, rate: Array, D: Array
    ) -> tuple[Array, Array, Array]:
        """Predicted camera pose (M, 3) at the grid point + offset (M,) [s], its Jacobian (M, 3, n) and derivatives (M, 3, K)."""
        nq, s = self.nq, self.sensors
        gain = np.array([s.camera_scale, s.camera_scale, 1.0])
        velocity = xi[:, nq : nq + 3] + offset[:, None] * rate[:, nq : nq + 3]
        here = (
            xi[:, :3]
            + offset[:, None] * xi[:, nq : nq + 3]
            + 0.5 * offset[:, None] ** 2 * rate[:, nq : nq + 3]
        )
        h = here * gain + np.array([0.0, 0.0, s.camera_heading_offset])
        H = np.zeros((self.trials, 3, self.n))
        H[:, range(3), range(3)] = gain
        H[:, range(3), range(nq, nq + 3)] = gain * offset[:, None]
        dh = H @ D
        if "camera_latency" in s.free:
            dh[:, :, s.free["camera_latency"]] -= (
                s.slope.get("camera_latency", 1.0) * gain * velocity
            )
        if "camera_scale" in s.free:
            dh[:, :2, s.free["camera_scale"]] += s.slope.get("camera_scale", 1.0) * here[:, :2]
        if "camera_heading_offset" in s.free:
            dh[:, 2, s.free["camera_heading_offset"]] += s.slope.get("camera_heading_offset", 1.0)
        return h, H, dh

    def _encoder(self, sums: Sums) -> None:
        """The encoder reads the rotor's speed, which follows from the commands alone."""
        T = self.experiment.length
        terms = encoder_terms(
            self.experiment, self.noise, self.memory[:T, ..., 1], self.d_memory[:T, ..., 1]
        )
        sums.log_likelihood += terms.log_likelihood
        sums.samples += terms.samples
        sums.gradient += terms.gradient
        sums.normal += terms.normal
        sums.whitened[..., ENCODER_ROW] = terms.whitened
