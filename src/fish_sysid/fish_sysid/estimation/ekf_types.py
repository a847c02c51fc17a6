# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter of the fish with forward sensitivities: the model, its numbers, its results.

State xi = [motion (q, q', states of effects), wrench on the head (3), biases of gyro and accelerometer (3)].
    motion' = f(motion, drive, p, wrench)          drive (rotor, rudder) known from the commands
    wrench' = -wrench / tau + noise                 the unexplained force
    gyro z = scale r + b_g;  accelerometer = R(-mu) R_body_pool q'' + b_a;  camera = pose(t - latency)
One pass gives the innovations, their covariance and, with the filter's gains held fixed, the derivative of every
innovation with respect to every free parameter (prediction-error method; Ljung 1999, ch. 7 and 10). Gauss-Newton,
score tests and the screening of candidates all come from the normal matrices that the pass adds up per trial.

The encoder needs no filter: the rotor's speed follows from the commands alone. Single samples of a real one can be far off (a
held rotor, a wrong stamp). A residual beyond the gate costs a constant and has no gradient.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT, Layout
from fish_sim.step import Stepper
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.thresholds import OPEN_GATE

Array = NDArray[np.float64]

# parameters of the model the filter drives
WRENCH = ("disturbance.surge", "disturbance.sway", "disturbance.yaw")
ROWS = ("gyro", "accel_forward", "accel_left", "camera_x", "camera_y", "camera_heading")
ENCODER_ROW = 6

AT_ONCE = 0.1  # s; a first pose that comes within it is the start's, of a camera that runs
FASTEST, FASTEST_TURN = 0.5, 2.0  # m/s and rad/s of a fish that nobody sees or feels


@dataclass(frozen=True)
class Noise:
    """Standard deviations. Sensors: per sample; wrench: stationary values of a first-order Gauss-Markov process."""

    wrench: tuple[float, float, float] = (0.004, 0.008, 2e-4)  # N, N, N m
    wrench_time: float = 0.2  # s, tau
    gyro: float = 0.006  # rad/s
    accel: float = 0.05  # m/s^2
    camera_position: float = 0.002  # m
    camera_heading: float = 0.012  # rad
    encoder: float = 0.15  # rad/s
    gyro_bias: float = 0.05  # rad/s, prior
    accel_bias: float = 0.3  # m/s^2, prior
    start_speed: float = 0.3  # m/s and rad/s x 10, prior of motion that does not start at rest
    gate_camera: float = 60.0  # poses whose squared normalised innovation exceeds this are left out
    gate_imu: float = 400.0  # likewise IMU samples
    gate_encoder: float = 25.0  # squared residual beyond which an encoder's sample costs no more

    def ungated(self) -> Noise:
        """The same noise without gates: a filter that leaves out what surprises it can lose the fish for good."""
        return replace(self, gate_camera=OPEN_GATE, gate_imu=OPEN_GATE)

    def with_imu(self, factor: float) -> Noise:
        """The IMU's standard deviations times a factor, without gates: with a large one the camera decides."""
        return replace(self.ungated(), gyro=factor * self.gyro, accel=factor * self.accel)

    def with_wrench(self, factor: float) -> Noise:
        """The wrench's standard deviations times a factor."""
        x, y, n = self.wrench
        return replace(self, wrench=(factor * x, factor * y, factor * n))


@dataclass(frozen=True)
class SensorModel:
    """What the sensors do to the truth; `free` maps a field to the index of its free parameter."""

    camera_latency: float = 0.0  # s, the image is older than its stamp
    camera_heading_offset: float = 0.0  # rad, measured minus true
    camera_scale: float = 1.0  # measured over true
    gyro_scale: float = 1.0  # measured over true
    imu_misalignment: float = 0.0  # rad, IMU axes counter-clockwise from base_link
    free: dict[str, int] = field(default_factory=dict)
    # d field / d free parameter, 1 where not given
    slope: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Problem:
    """What is filtered, with which model; the noise may be one of several."""

    experiment: Experiment
    stepper: Stepper  # with the effect `disturbance`
    p: Array  # (NP,) parameters of the stepper
    dp: Array  # (K, NP) their derivatives with respect to the free parameters
    sensors: SensorModel


@dataclass(frozen=True)
class FilterResult:
    """Sums per trial and, if asked, everything along the way."""

    log_likelihood: Array  # (M,)
    samples: Array  # (M,) scalar measurements used
    gradient: Array  # (M, K) d(-log likelihood)/d theta with gains held fixed
    normal: Array  # (M, K, K) Gauss-Newton matrix of -log likelihood
    whitened: Array  # (T, M, 7) innovations over their standard deviation, NaN where there is none
    history: History | None


@dataclass(frozen=True)
class History:
    """Filtered and predicted moments for the smoother; `filtered` is NaN from where a trial's filter diverged."""

    predicted: Array  # (T, M, N)
    predicted_P: Array  # (T, M, N, N)
    filtered: Array  # (T, M, N)
    filtered_P: Array  # (T, M, N, N)
    transition: Array  # (T, M, N, N)
    memory: Array  # (T + 1, M, NM)


def drive_at(start: Array, end: Array, fraction: float) -> Array:
    """Rudder, its rate, rotor speed, its rate (..., 4) at a fraction of a period between two memories (..., 2)."""
    rate = (end - start) / DT
    now = start + fraction * (end - start)
    return np.stack([now[..., 0], rate[..., 0], now[..., 1], rate[..., 1]], axis=-1)


def place_frames(experiment: Experiment, sensors: SensorModel) -> tuple[Array, Array]:
    """(offset (T, M), pose (T, M, 3)): each camera pose at its nearest grid point, moved back by the latency.

    One that is a little less than a step after the one before (see `apart`) goes to the grid point after it if need be: which
    poses are used does not depend on the latency, or the likelihood would jump with it.
    """
    T, M = experiment.length, len(experiment.names)
    offset, pose = np.full((T, M), np.nan), np.full((T, M, 3), np.nan)
    for m, frames in enumerate(experiment.frames):
        t = frames.t - sensors.camera_latency
        order = np.arange(len(t))
        k = np.maximum.accumulate(np.floor(t / DT + 0.5).astype(int) - order) + order
        inside = (k >= 0) & (k < experiment.steps[m])
        offset[k[inside], m] = (t - k * DT)[inside]
        pose[k[inside], m] = frames.pose[inside]
    return offset, pose


def first_commands(experiment: Experiment) -> Array:
    """(M, 2) what servo and motor have followed at the first grid point: the first command, or none of a fish at rest."""
    return (
        np.zeros((len(experiment.names), 2)) if experiment.start_at_rest else experiment.commands[0]
    )


def follow_commands(problem: Problem, before: Array, commands: Array) -> tuple[Array, Array]:
    """Memory (T + 1, M, NM) of servo and motor, which needs no motion, and its derivatives (T + 1, M, K, NM).

    commands (T, M, 2) of some trials; before (M, 2): what was commanded long before. A centred command leaves something too:
    the rudder of an offset horn is deflected from the start.
    """
    stepper, p, dp = problem.stepper, problem.p, problem.dp
    M, K, rows = len(before), len(dp), max(len(dp), 1)
    directions = np.tile(dp, (M, 1)) if K else np.zeros((M, len(p)))
    start, d_start = stepper.settled_memory(np.repeat(before, rows, axis=0), p, directions)
    repeated = np.repeat(commands, rows, axis=1)
    memory, d_memory = (
        a.reshape(len(a), M, rows, -1)
        for a in stepper.memory_jvp(start, repeated, p, directions, d_start)
    )
    return memory[:, :, 0], d_memory[:, :, :K]


def first_state(
    experiment: Experiment, layout: Layout, sensors: SensorModel, noise: Noise
) -> tuple[Array, Array]:
    """Prior of the state (M, N) and its covariance: at the first camera pose with a straight tail.

    Where that pose comes late the fish began elsewhere, at a heading from which the gyro counts to the one seen.
    """
    M, nq, nx = len(experiment.names), layout.links + 3, len(layout.motion)
    n, rest = nx + 6, experiment.start_at_rest
    xi, variance, P = np.zeros((M, n)), np.zeros(n), np.zeros((M, n, n))
    for m, frames in enumerate(experiment.frames):
        xi[m, :2] = frames.pose[0, :2] / sensors.camera_scale
        xi[m, 2:nq] = frames.pose[0, 2] - sensors.camera_heading_offset
        if (late := float(frames.t[0]) - sensors.camera_latency) > AT_ONCE:
            turned, position, heading = _until_seen(
                experiment.gyro[: experiment.steps[m], m], late, noise
            )
            xi[m, 2:nq] -= turned
            P[m, range(2), range(2)] = position**2
            P[m, 2:nq, 2:nq] = heading**2
    speed = 1e-3 if rest else noise.start_speed
    variance[:2] = 0.05**2
    variance[2:nq] = 1e-6 if rest else 0.2**2
    variance[nq : nq + 2] = speed**2
    variance[nq + 2 : 2 * nq] = (10.0 * speed) ** 2
    variance[nx : nx + 3] = np.square(noise.wrench)
    variance[nx + 3 :] = np.square([noise.gyro_bias, noise.accel_bias, noise.accel_bias])
    P[:, range(n), range(n)] += variance
    P[:, 2:nq, 2:nq] += 0.1**2  # head and tail turn together
    return xi, P


def _until_seen(gyro: Array, late: float, noise: Noise) -> tuple[float, float, float]:
    """(angle [rad] that a fish first seen `late` [s] has turned by then, how far off its start may be [m] and its heading [rad]).

    gyro (T,) [rad/s], NaN without a sample.
    """
    before = gyro[: round(late / DT)]
    felt, waited = np.isfinite(before), late - AT_ONCE
    unsure = noise.gyro_bias * waited + FASTEST_TURN * DT * float((~felt).sum())
    return DT * float(before[felt].sum()), FASTEST * waited, unsure


@dataclass(frozen=True)
class EncoderTerms:
    """What the encoder adds to a pass over M trials with K free parameters."""

    # (M,) sum of -min(r^2, gate) / 2 - log(sd sqrt(2 pi)), r = (encoder - rotor) / sd
    log_likelihood: Array
    samples: Array  # (M,)
    gradient: Array  # (M, K) of -log likelihood
    normal: Array  # (M, K, K)
    whitened: Array  # (T, M) r, NaN without a sample


def encoder_terms(
    experiment: Experiment, noise: Noise, rotor: Array, d_rotor: Array
) -> EncoderTerms:
    """Terms of the model's rotor speed (T, M) [rad/s] and of its derivatives (T, M, K)."""
    sampled = np.isfinite(experiment.encoder) & (
        np.arange(experiment.length)[:, None] < experiment.steps
    )
    r = np.where(sampled, (experiment.encoder - rotor) / noise.encoder, 0.0)
    inside = sampled & (r**2 < noise.gate_encoder)
    pull, J = np.where(inside, r, 0.0), -np.where(inside[..., None], d_rotor, 0.0) / noise.encoder
    samples = sampled.sum(axis=0)
    rows, columns = J.transpose(1, 2, 0), J.transpose(1, 0, 2)  # by trial
    return EncoderTerms(
        -0.5 * np.sum(np.minimum(r**2, noise.gate_encoder), axis=0)
        - samples * np.log(noise.encoder * np.sqrt(2.0 * np.pi)),
        samples,
        (rows @ pull.T[..., None])[..., 0],
        rows @ columns,
        np.where(sampled, r, np.nan),
    )
