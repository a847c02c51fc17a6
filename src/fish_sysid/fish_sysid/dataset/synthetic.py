# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in which the truth is known: made by the model itself, or recorded ones with an effect put in exactly.

Of the model's, sensor noise is that of `Noise`; frame times and constant biases are those of `fish_sim.sensors.noise_levels`;
the water pushes the head as in `fish_sim.water_push`.

What is put into recordings needs no model of the fish. A current is a change of frame: the fish swims in the same water, which
now moves. An old image is a stamp that is late. A scale, a turned sensor or marker changes numbers. A rudder's gain, offset or
delay changes the log: what was commanded becomes what a servo with that effect would have had to be commanded, so that the fish
does the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.sensors.noise_levels import BIAS, CAMERA_RATE, exposure_times
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.grid import apart, in_base_link
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
    return state[..., nq + 2], np.stack(in_base_link(ax, ay, state[..., 2]), axis=-1)


def _camera(pose: Array, noise: Noise, random: np.random.Generator, rate: float) -> Frames:
    """Poses at jittered times, some lost, those of a fast camera thinned as those of recordings are."""
    end = DT * (len(pose) - 1)
    t = exposure_times(end, random, rate)
    t = t[apart(t, DT)]
    seen = np.column_stack([np.interp(t, DT * np.arange(len(pose)), pose[:, i]) for i in range(3)])
    sd = np.array([noise.camera_position, noise.camera_position, noise.camera_heading])
    return Frames(t, seen + sd * random.standard_normal(seen.shape))


def with_injection(experiment: Experiment, name: str, values: Mapping[str, float]) -> Experiment:
    """The recordings with this effect of the vocabulary. Raises ValueError for one that cannot be put in exactly."""
    if name not in INJECTIONS:
        raise ValueError(f"injection {name!r}: expected one of {', '.join(INJECTIONS)}")
    return INJECTIONS[name](experiment, **values)


def with_current(experiment: Experiment, velocity: tuple[float, float]) -> Experiment:
    """The same fish in water that moves with `velocity` (x, y) [m/s] in the pool frame: poses move by velocity * t."""
    shift = np.array([*velocity, 0.0])
    return _with_poses(experiment, lambda f: f.pose + f.t[:, None] * shift)


def with_image_age(experiment: Experiment, age: float) -> Experiment:
    """The same recordings with every image stamped `age` [s] later than now; those after a trial's end are left out."""
    frames = []
    for f, steps in zip(experiment.frames, experiment.steps, strict=True):
        kept = f.t + age <= DT * (steps - 1)
        frames.append(Frames(f.t[kept] + age, f.pose[kept]))
    return replace(experiment, frames=tuple(frames))


def with_camera_scale(experiment: Experiment, factor: float) -> Experiment:
    """Positions of the camera `factor` times as large."""
    return _with_poses(experiment, lambda f: f.pose * [factor, factor, 1.0])


def with_heading_offset(experiment: Experiment, offset: float) -> Experiment:
    """The heading marker turned by `offset` [rad]."""
    return _with_poses(experiment, lambda f: f.pose + [0.0, 0.0, offset])


def with_gyro_scale(experiment: Experiment, factor: float) -> Experiment:
    """A gyro that reads `factor` times the rate."""
    return replace(experiment, gyro=factor * experiment.gyro)


def with_turned_imu(experiment: Experiment, angle: float) -> Experiment:
    """The IMU turned by `angle` [rad] about z: measured = R(-angle) specific force."""
    cos, sin = np.cos(angle), np.sin(angle)
    ahead, left = np.moveaxis(experiment.accel, -1, 0)
    turned = np.stack([cos * ahead + sin * left, cos * left - sin * ahead], axis=-1)
    return replace(experiment, accel=turned)


def with_rudder_gain(experiment: Experiment, factor: float) -> Experiment:
    """A servo that goes `factor` times as far as commanded."""
    return _with_rudder(experiment, lambda rudder, _: rudder / factor)


def with_rudder_offset(experiment: Experiment, offset: float) -> Experiment:
    """A servo whose zero is at `offset` [rad]."""
    return _with_rudder(experiment, lambda rudder, _: rudder - offset)


def with_rudder_delay(experiment: Experiment, delay: float) -> Experiment:
    """A servo that gets its commands `delay` [s] late; after the last recorded command it is held."""
    return _with_rudder(experiment, lambda rudder, t: np.interp(t + delay, t, rudder))


def _with_poses(experiment: Experiment, change: Callable[[Frames], Array]) -> Experiment:
    frames = tuple(Frames(f.t, change(f)) for f in experiment.frames)
    return replace(experiment, frames=frames)


def _with_rudder(experiment: Experiment, change: Callable[[Array, Array], Array]) -> Experiment:
    commands = experiment.commands.copy()
    for m, steps in enumerate(experiment.steps):
        t = DT * np.arange(steps)
        commands[:steps, m, 1] = change(commands[:steps, m, 1], t)
    return replace(experiment, commands=commands)


INJECTIONS: dict[str, Callable[..., Experiment]] = {
    "current": lambda experiment, x, y: with_current(experiment, (x, y)),
    "camera_latency": lambda experiment, delay: with_image_age(experiment, delay),
    "camera_scale": with_camera_scale,
    "camera_heading_offset": with_heading_offset,
    "gyro_scale": with_gyro_scale,
    "imu_misalignment": with_turned_imu,
    "rudder_gain": with_rudder_gain,
    "rudder_offset": with_rudder_offset,
    "rudder_delay": with_rudder_delay,
}
