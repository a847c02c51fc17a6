# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What swims say of a model's parameters, and how its filter answers to what the model lacks.

    N = sum of J' J,   J = d e / d theta      e: whitened innovations of the filter that fits the model (`estimation.ekf_types`)

The filter is fed with what the robot's sensors would show: the model's recordings without noise, pushes of the water and biases.
Those of the model's own robot give N, the information of a design; those of a robot that has something else give the signal that
`identify` and `diagnose` would see.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.step import Stepper
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.synthetic import true_imu
from fish_sysid.estimation.ekf import run_filters
from fish_sysid.estimation.ekf_types import Noise, Problem
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import Hypothesis

Array = NDArray[np.float64]

STEP = 0.01  # of theta, for differences


@dataclass(frozen=True)
class SensorSet:
    """Which sensors the robot has and how often they measure [Hz]; 0: not at all."""

    camera: float = 30.0
    imu: float = 100.0
    encoder: float = 100.0

    def __post_init__(self) -> None:
        if not self.camera > 0.0:
            raise ValueError(f"camera: got {self.camera:g} Hz; expected more than 0")
        for name, rate in (("imu", self.imu), ("encoder", self.encoder)):
            if not 0.0 <= rate <= 1.0 / DT:
                raise ValueError(f"{name}: got {rate:g} Hz; expected 0 (none) to {1.0 / DT:g}")


@dataclass(frozen=True)
class Swims:
    """M swims side by side, from rest; padded to the longest."""

    commands: Array  # (T, M, 2) rotor speed [rad/s], rudder [rad]
    steps: NDArray[np.int64]  # (M,) grid points
    start: Array  # (M, 3) pose at rest, x, y [m], heading [rad]


def states(robot: Robot, swims: Swims) -> Array:
    """(T, M, NS) states at the grid points. Raises FloatingPointError where the motion diverges."""
    stepper = Stepper.of(robot)
    p = stepper.parameters(robot)
    start = np.tile(stepper.rest(parameters=p), (len(swims.start), 1))
    start[:, :2] = swims.start[:, :2]
    start[:, 2 : 3 + robot.links] = swims.start[:, 2:]
    found = stepper.rollout(start, swims.commands[:-1], p)
    if not np.isfinite(found).all():
        raise FloatingPointError("the simulated motion diverges")
    return found


def shown(robot: Robot, swims: Swims, sensors: SensorSet) -> Experiment:
    """The experiment that the robot's sensors, with their own errors, would record."""
    pushed = robot.with_effect("disturbance")
    state = states(pushed, swims)
    T, M = swims.commands.shape[:2]
    stepper = Stepper.of(pushed)
    rate, force = true_imu(
        stepper, stepper.parameters(pushed), state, np.zeros((T, M, 3)), swims.commands
    )
    distortion = SensorDistortion(robot.sensors)
    ahead, left, turning = distortion.imu(force[..., 0], force[..., 1], rate)  # type: ignore[arg-type]
    late = distortion.imu_delay()
    gyro, accel = (_late(np.stack(a, axis=-1), late) for a in ([turning], [ahead, left]))
    rotor = state[:, :, len(stepper.layout.motion) + 1]
    frames = tuple(
        _frames(state[: swims.steps[m], m, :3], sensors.camera, distortion) for m in range(M)
    )
    return Experiment(
        tuple(f"swim_{m:02d}" for m in range(M)),
        swims.steps,
        swims.commands,
        _sampled(gyro[..., 0], sensors.imu),
        _sampled(accel, sensors.imu),
        _sampled(rotor, sensors.encoder),
        frames,
        start_at_rest=True,
    )


def _late(values: Array, delay: float) -> Array:
    """Values (T, ...) as they were `delay` [s] before; the first one before that."""
    at = np.clip(np.arange(len(values)) - delay / DT, 0.0, len(values) - 1.0)
    low = np.minimum(at.astype(int), len(values) - 2)
    share = (at - low).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray(values[low] + share * (values[low + 1] - values[low]))


def _sampled(values: Array, rate: float) -> Array:
    """Values (T, ...) at the grid points nearest to a rate [Hz], NaN between them."""
    out = np.full_like(values, np.nan)
    if rate > 0.0:
        rows = np.unique(np.round(np.arange(0.0, len(values), 1.0 / (rate * DT))).astype(int))
        rows = rows[rows < len(values)]
        out[rows] = values[rows]
    return out


def _frames(pose: Array, rate: float, distortion: SensorDistortion) -> Frames:
    """What the camera shows of poses (T, 3)."""
    grid = DT * np.arange(len(pose))
    t = np.arange(0.0, grid[-1], max(1.0 / rate, DT))
    late = np.maximum(t - distortion.pose_delay(), 0.0)
    true = [np.interp(late, grid, pose[:, i]) for i in range(3)]
    return Frames(t, np.column_stack(distortion.pose(*true)))  # type: ignore[arg-type]


def information(hypothesis: Hypothesis, swims: Swims, sensors: SensorSet, noise: Noise) -> Array:
    """(M, K, K) what each swim says of theta where the robot is that of the hypothesis."""
    theta = hypothesis.parametrization.origin()
    recorded = shown(hypothesis.parametrization.robot(theta), swims, sensors)
    return evaluate(hypothesis, theta, recorded, noise.ungated()).result.normal


def innovations(hypothesis: Hypothesis, experiment: Experiment, noise: Noise) -> Array:
    """(R,) whitened innovations of the hypothesis's filter, without gates, 0 where nothing is measured."""
    p, _, sensors = hypothesis.parametrization.filter_inputs(hypothesis.parametrization.origin())
    plain = replace(sensors, free={}, slope={})
    stepper = hypothesis.parametrization.stepper
    problem = Problem(experiment, stepper, p, np.zeros((0, len(p))), plain)
    (found,) = run_filters(problem, [noise.ungated()])
    return np.nan_to_num(found.whitened).ravel()


def signals_of_parameters(
    hypothesis: Hypothesis, swims: Swims, sensors: SensorSet, noise: Noise, base: Array
) -> Array:
    """(R, K) change of the innovations, from base (R,), for each unit of theta by which the robot differs from the model."""
    coordinates = hypothesis.parametrization
    theta = coordinates.origin()

    def change(k: int) -> Array:
        moved = theta.copy()
        moved[k] += STEP
        robot: Robot = coordinates.robot(moved)
        return (innovations(hypothesis, shown(robot, swims, sensors), noise) - base) / STEP

    return np.array([change(k) for k in range(len(theta))]).T.reshape(len(base), len(theta))
