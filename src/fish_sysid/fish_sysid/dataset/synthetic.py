# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings made by the model itself, for studies in which the truth is known.

Sensor noise is that of `Noise`; frame times and constant biases are those of `fish_sim.sensors.noise_levels`; the water
pushes the head as in `fish_sim.water_push`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.sensors.noise_levels import BIAS, CAMERA_RATE, exposure_times
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.resample import apart
from fish_sysid.estimation.ekf_types import WRENCH, Noise

Array = NDArray[np.float64]

STROKE = 2.0  # Hz
FULL_SPEED = 12.0 * 2.0 * np.pi * STROKE  # rad/s, amplitude of the rotor's speed at full throttle
KINDS = ("straight", "steps", "sines", "turn", "random")


@dataclass(frozen=True)
class Truth:
    """What the sensors looked at."""

    state: Array  # (T, M, NS)
    bias: Array  # (M, 3)


def program(kind: str, duration: float, random: np.random.Generator) -> Array:
    """Commands (T, 2) of one open-loop manoeuvre: rotor speed [rad/s] and rudder [rad]."""
    t = DT * np.arange(round(duration / DT))
    amplitude = FULL_SPEED * np.sqrt(random.uniform(0.05, 0.4)) * np.minimum(1.0, t)
    if kind == "straight":
        rudder = np.zeros_like(t)
        amplitude = amplitude * np.where(t < 0.6 * duration, 1.0, random.uniform(0.0, 0.6))
    elif kind == "steps":
        rudder = random.uniform(0.2, 0.6) * np.sign(
            np.sin(2.0 * np.pi * t / random.uniform(3.0, 6.0))
        )
    elif kind == "sines":
        rudder = random.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * t * random.uniform(0.2, 0.6))
    elif kind == "turn":
        rudder = np.full_like(t, random.choice([-1.0, 1.0]) * random.uniform(0.2, 0.5))
    elif kind == "random":
        rudder = np.repeat(random.uniform(-0.6, 0.6, len(t) // 100 + 1), 100)[: len(t)]
    else:
        raise ValueError(f"kind of manoeuvre: got {kind!r}; expected one of {', '.join(KINDS)}")
    return np.column_stack([amplitude * np.sin(2.0 * np.pi * STROKE * t), rudder])


def record(
    robot: Robot,
    commands: Array,
    noise: Noise,
    random: np.random.Generator,
    camera_rate: float = CAMERA_RATE,
) -> tuple[Experiment, Truth]:
    """An experiment of the robot under commands (T, M, 2), from rest, with random wrench and sensor noise of `noise`."""
    pushed = robot.with_effect("disturbance")
    stepper = Stepper.of(pushed)
    state, wrench = _swim(stepper, stepper.parameters(pushed), commands, noise, random)
    felt = true_imu(stepper, stepper.parameters(pushed), state, wrench, commands)
    rotor = state[:, :, len(stepper.layout.motion) + 1]
    made, bias = sensed(commands, state[..., :3], *felt, rotor, noise, random, camera_rate)
    return made, Truth(state, bias)


def sensed(
    commands: Array,
    pose: Array,
    gyro: Array,
    accel: Array,
    rotor: Array,
    noise: Noise,
    random: np.random.Generator,
    camera_rate: float = CAMERA_RATE,
) -> tuple[Experiment, Array]:
    """(what sensors say, their biases (M, 3)) of any plant's true motion on the grid.

    commands (T, M, 2); pose (T, M, 3); gyro (T, M) [rad/s]; accel (T, M, 2) forward and left [m/s^2]; rotor (T, M) [rad/s].
    """
    T, M = commands.shape[:2]
    bias = random.standard_normal((M, 3)) * BIAS
    gyro = gyro + bias[:, 0] + noise.gyro * random.standard_normal((T, M))
    accel = accel + bias[:, 1:] + noise.accel * random.standard_normal((T, M, 2))
    encoder = rotor + noise.encoder * random.standard_normal((T, M))
    frames = tuple(_camera(pose[:, m], noise, random, camera_rate) for m in range(M))
    names = tuple(f"synthetic_{m:02d}" for m in range(M))
    steps = np.full(M, T)
    return Experiment(names, steps, commands, gyro, accel, encoder, frames, True), bias


def _swim(
    stepper: Stepper, p: Array, commands: Array, noise: Noise, random: np.random.Generator
) -> tuple[Array, Array]:
    """States (T, M, NS) at the grid points and the wrench (T, M, 3) from each grid point to the next."""
    T, M = commands.shape[:2]
    at = [stepper.layout.parameters.index(name) for name in WRENCH]
    water = WaterPush(np.array(noise.wrench), noise.wrench_time)
    wrench = np.empty((T, M, 3))
    wrench[0] = water.first(random.standard_normal((M, 3)))
    for k in range(1, T):
        wrench[k] = water.after(wrench[k - 1], random.standard_normal((M, 3)))
    states = np.empty((T, M, len(stepper.layout.state)))
    states[0] = stepper.rest(parameters=p)
    p = np.tile(p, (M, 1))
    for k in range(T - 1):
        p[:, at] = wrench[k]
        states[k + 1] = stepper.rollout(states[k], commands[k : k + 1], p)[1]
    return states, wrench


def true_imu(
    stepper: Stepper, p: Array, state: Array, wrench: Array, commands: Array
) -> tuple[Array, Array]:
    """True yaw rate (T, M) and acceleration forward and left (T, M, 2) just after the grid points."""
    T, M = commands.shape[:2]
    layout = stepper.layout
    nx, nq = len(layout.motion), layout.links + 3
    at = [layout.parameters.index(name) for name in WRENCH]
    ahead = np.concatenate([state[1:, :, nx : nx + 2], state[-1:, :, nx : nx + 2]])
    here = state[:, :, nx : nx + 2]
    rate = (ahead - here) / DT
    drive = np.stack([here[..., 0], rate[..., 0], here[..., 1], rate[..., 1]], axis=-1).reshape(
        T * M, 4
    )
    all_p = np.tile(p, (T * M, 1))
    all_p[:, at] = wrench.reshape(T * M, 3)
    motion = state[..., :nx].reshape(T * M, nx)
    rates, _ = stepper.rates_jvp(
        motion, drive, all_p, np.zeros_like(motion), np.zeros_like(drive), np.zeros_like(all_p)
    )
    ax, ay = rates[:, nq].reshape(T, M), rates[:, nq + 1].reshape(T, M)
    cos, sin = np.cos(state[..., 2]), np.sin(state[..., 2])
    return state[..., nq + 2], np.stack([ax * cos + ay * sin, ay * cos - ax * sin], axis=-1)


def _camera(pose: Array, noise: Noise, random: np.random.Generator, rate: float) -> Frames:
    """Poses at jittered times, some lost, those of a fast camera thinned as those of recordings are."""
    end = DT * (len(pose) - 1)
    t = exposure_times(end, random, rate)
    t = t[apart(t, DT)]
    seen = np.column_stack([np.interp(t, DT * np.arange(len(pose)), pose[:, i]) for i in range(3)])
    sd = np.array([noise.camera_position, noise.camera_position, noise.camera_heading])
    return Frames(t, seen + sd * random.standard_normal(seen.shape))
