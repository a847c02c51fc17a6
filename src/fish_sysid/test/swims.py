# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small data sets with known answers: a fish of one link in short swims, and swims written down as kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fish_node.pool import LENGTH, WIDTH
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise

GIVEN = Robot(links=1)


def fish(links: int = 1, **effects: Mapping[str, float]) -> Robot:
    """A fish whose drags and tail differ from the nominal ones by up to a third, with these effects."""
    robot = Robot(links=links)
    stiffness = 1.1 * robot.parameters["tail_stiffness"]
    robot = robot.with_parameters(
        head_drag_surge=0.26, head_drag_sway=1.2, tail_stiffness=stiffness
    )
    for name, values in effects.items():
        robot = robot.with_effect(name, **values)
    return robot


def swim(
    robot: Robot,
    kinds: Sequence[str] = ("sines", "steps", "random"),
    duration: float = 5.0,
    seed: int = 0,
    noise: Noise | None = None,
) -> Experiment:
    """Its recordings, a trial for each kind of manoeuvre."""
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    return record(robot, commands, noise or Noise(), random)[0]


STROKE = 2.0  # Hz
FRAME_RATE = 30.0


@dataclass(frozen=True)
class World:
    """What is hidden in the recordings; the neutral values hide nothing."""

    flow: tuple[float, float] = (0.0, 0.0)  # m/s
    shear: float = 0.0  # 1/s, of the flow along the pool across it
    gyro_factor: float = 1.0
    camera_factor: float = 1.0
    heading_offset: float = 0.0  # rad
    imu_angle: float = 0.0  # rad
    encoder_steps: int = 0  # grid points by which the encoder is late
    turns: bool = True
    swing: float = 0.05  # rad, of the heading with every stroke
    speeds: tuple[float, float] = (40.0, 90.0)  # rad/s, range of the rotor's amplitude
    one_heading: bool = False
    wall: float = 0.0  # share of its speed that the fish loses at a wall; it then starts at one
    wait: float = 0.0  # s before the rotor starts


def kinematic_swims(
    world: World, seed: int = 0, trials: int = 6, duration: float = 16.0
) -> Experiment:
    """Trials of a fish that follows its commands with lags and swings with its strokes."""
    random = np.random.default_rng(seed)
    made = [_swim(world, random, round(duration / DT)) for _ in range(trials)]
    stacked = [np.stack([one[i] for one in made], axis=1) for i in range(4)]
    frames = tuple(one[4] for one in made)
    names, steps = tuple(f"swim_{m}" for m in range(trials)), np.full(trials, len(stacked[0]))
    return Experiment(names, steps, *stacked, frames=frames, start_at_rest=False)


def _commands(world: World, random: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Rotor amplitude and rudder that step every three seconds."""
    steps = (t // 3.0).astype(int)
    amplitude = random.uniform(*world.speeds, steps[-1] + 1)[steps] * (t >= world.wait)
    rudder = random.uniform(-0.4, 0.4, steps[-1] + 1)[steps] * world.turns
    return np.column_stack([amplitude * np.sin(2.0 * np.pi * STROKE * (t - world.wait)), rudder])


def _swim(world: World, random: np.random.Generator, count: int) -> tuple:
    t = DT * np.arange(count)
    commands = _commands(world, random, t)
    power = _lagged(commands[:, 0] ** 2, 0.5)
    u = _lagged(0.13 * np.sqrt(power / 2000.0), 0.5)
    rate = _lagged(2.0 * commands[:, 1], 0.4)
    start = 0.3 if world.one_heading else random.uniform(-np.pi, np.pi)
    place = np.array([random.uniform(-0.6, 0.6), random.uniform(-0.4, 0.4)])
    if world.wall:
        side = random.choice([-1.0, 1.0])
        place = np.array([2.0 * place[0], side * (0.5 * WIDTH - 0.03)])
        start = -side * 0.5 * np.pi + random.uniform(-0.5, 0.5)
    swing = world.swing * np.sin(2.0 * np.pi * STROKE * t) * (t >= world.wait)
    heading = start + DT * np.cumsum(rate) + swing
    cos, sin = np.cos(heading), np.sin(heading)
    v = -0.06 * rate + 0.02 * np.cos(2.0 * np.pi * STROKE * t) * (t >= world.wait)
    velocity = np.column_stack([u * cos - v * sin, u * sin + v * cos])
    position = np.empty((count, 2))
    for k in range(count):
        position[k] = place
        gap = min(0.5 * LENGTH - abs(place[0]), 0.5 * WIDTH - abs(place[1]))
        velocity[k] *= 1.0 - world.wall * np.exp(-max(gap, 0.0) / 0.2)
        velocity[k] += (world.flow[0] + world.shear * place[1], world.flow[1])
        place = place + DT * velocity[k]
    felt = np.gradient(velocity, DT, axis=0)
    ahead, left = felt[:, 0] * cos + felt[:, 1] * sin, felt[:, 1] * cos - felt[:, 0] * sin
    ca, sa = np.cos(world.imu_angle), np.sin(world.imu_angle)
    accel = np.column_stack([ca * ahead + sa * left, ca * left - sa * ahead])
    accel += random.normal(0.0, 0.1, 2) + 0.05 * random.standard_normal((count, 2))
    gyro = world.gyro_factor * np.gradient(heading, DT) + random.normal(0.0, 0.01)
    gyro += 0.006 * random.standard_normal(count)
    encoder = np.roll(commands[:, 0], world.encoder_steps) + 0.5 * random.standard_normal(count)
    seen = np.arange(0.0, t[-1], 1.0 / FRAME_RATE)
    pose = np.column_stack([np.interp(seen, t, c) for c in (*position.T, heading)])
    pose = pose * [world.camera_factor, world.camera_factor, 1.0] + [0.0, 0.0, world.heading_offset]
    pose += random.standard_normal(pose.shape) * [0.003, 0.003, 0.012]
    return commands, gyro, accel, encoder, Frames(seen, pose)


def _lagged(values: np.ndarray, time: float) -> np.ndarray:
    """First-order lag."""
    out = np.empty_like(values)
    state = values[0]
    for k, value in enumerate(values):
        state += DT / time * (value - state)
        out[k] = state
    return out
