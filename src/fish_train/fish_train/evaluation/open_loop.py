# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swims without a controller, a rotor that swings and a rudder that stays, and the control law's feed-forward found by them.

Throttle, rudder and slip of steady swims, straight and in turns:

    s                   = a u + b u |u|                           straight
    s                   = a u + b u |u| + alpha^2 (c u + d u |u|)  with the rudder at alpha
    alpha               = k kappa                                  kappa = r / u: curvature of the turn
    -v / u              = (a_0 + a_1 u) kappa                      slip

u, v [m/s], r [rad/s]: surge, sway and yaw rate, means over whole strokes. Every swim is made on two opposite headings,
whose mean a steady current leaves as it is. All constants >= 0 (`scipy.optimize.nnls`), k > 0.

Source: this project; the defaults of `ControlLimits` and `GuidanceConfig` are those of the nominal fish.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fish_control.control_law import ControlLimits, amplitude_of_throttle
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper
from fish_train.evaluation.plant import FishSimPlant, Plant
from fish_train.training.closed_loop_equations import Law

Array = NDArray[np.float64]
# of `speed_of_throttle`
SPEED_SETTLING = 20.0  # s until the mean speed no longer changes
SPEED_AVERAGING = 2.0  # s, four strokes
# of `steady_swims`
THROTTLES = (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8)  # straight
TURNING_THROTTLES, RUDDERS = (0.15, 0.35, 0.6), (0.1, 0.2, 0.3, 0.45)  # rad, to both sides
SETTLING, AVERAGING = 16.0, 4.0  # s
# of the pool, not of the robot
OF_A_PLACE = ("current", "nonuniform_current", "sloshing", "tether", "wall_effect")
SLOWEST = 0.02  # m/s, at full throttle: what is slower does not swim


@dataclass(frozen=True)
class Swim:
    """(T,) time [s], (T, 3) x, y [m], heading [rad], (T, 3) surge, sway [m/s], yaw rate [rad/s]."""

    time: Array
    pose: Array
    velocity: Array


def swing(
    robot: Robot, amplitude: Array, frequency: float, seconds: float, rudder: float = 0.0
) -> list[Swim]:
    """Rotor speed A w sin(w t) for each amplitude A (B,) [rad], from rest at the origin."""
    stepper = Stepper.of(robot)
    time: Array = DT * np.arange(round(seconds / DT) + 1, dtype=float)
    w = 2.0 * np.pi * frequency
    speeds = np.asarray(amplitude)[None, :] * w * np.sin(w * time[1:, None])
    commands = np.stack([speeds, np.full_like(speeds, rudder)], axis=-1)
    start = np.tile(stepper.rest(), (len(amplitude), 1))
    states = stepper.rollout(start, commands, stepper.parameters(robot))
    size = stepper.layout.links + 3
    return [_swim(time, states[:, k], size) for k in range(len(amplitude))]


def speed_of_throttle(robot: Robot, throttle: Array, limits: ControlLimits) -> Array:
    """Mean surge speed [m/s] of steady swimming at throttles s (B,)."""
    amplitude = amplitude_of_throttle(np.asarray(throttle), limits, np)
    swims = swing(robot, amplitude, limits.frequency, SPEED_SETTLING + SPEED_AVERAGING)
    return np.array([swim.velocity[swim.time >= SPEED_SETTLING, 0].mean() for swim in swims])


def _swim(time: Array, states: Array, size: int) -> Swim:
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    vx, vy, rate = states[:, size : size + 3].T
    return Swim(
        time, states[:, :3], np.column_stack([cos * vx + sin * vy, cos * vy - sin * vx, rate])
    )


class DoesNotSwim(ValueError):
    """A robot without a steady forward speed."""


@dataclass(frozen=True)
class SteadySwim:
    """Means over whole strokes, each (S,): throttle, rudder [rad]; surge, sway [m/s], yaw rate [rad/s]."""

    throttle: Array
    alpha: Array
    surge: Array
    sway: Array
    yaw_rate: Array


def law_of_robot(robot: Robot) -> Law:
    """The law with the feed-forward of this robot in still water far from walls. Raises DoesNotSwim."""
    swimmer = replace(
        robot, effects={n: v for n, v in robot.effects.items() if n not in OF_A_PLACE}
    )
    return law_of_plant(lambda count: FishSimPlant([swimmer] * count, range(count)))


def law_of_plant(make_plant: Callable[[int], Plant]) -> Law:
    """The law with the feed-forward of what swims; make_plant(count): so many equal robots. Raises DoesNotSwim."""
    law = Law()
    rows = [(s, 0.0) for s in THROTTLES]
    rows += [
        (s, sign * alpha) for s in TURNING_THROTTLES for alpha in RUDDERS for sign in (1.0, -1.0)
    ]
    return fitted_law(steady_swims(make_plant(2 * len(rows)), rows, law.limits), law)


def steady_swims(
    plant: Plant, rows: Sequence[tuple[float, float]], limits: ControlLimits
) -> SteadySwim:
    """Swim (throttle, rudder [rad]) of each row on two opposite headings with a plant of twice as many robots."""
    throttle, alpha = np.array(rows).T
    plant.reset(np.column_stack([np.zeros((2 * len(rows), 2)), np.repeat([0.0, np.pi], len(rows))]))
    w = 2.0 * np.pi * limits.frequency
    speed = np.tile(amplitude_of_throttle(throttle, limits, np) * w, 2)
    rudder = np.tile(alpha, 2)
    begin, end = round(SETTLING / DT), round((SETTLING + AVERAGING) / DT)
    total = np.zeros((2 * len(rows), 3))
    for k in range(1, end + 1):
        plant.step(np.column_stack([speed * np.sin(w * k * DT), rudder]))
        if k > begin:
            total += plant.motion[:, 3:]
    mean = (total / (end - begin)).reshape(2, len(rows), 3).mean(axis=0)
    return SteadySwim(throttle, alpha, *mean.T)


def fitted_law(swims: SteadySwim, law: Law) -> Law:
    """`law` with the least squares of the equations above. Raises DoesNotSwim."""
    u, alpha = swims.surge, swims.alpha
    straight = alpha == 0.0
    if not (np.isfinite(u).all() and u[straight].max() > SLOWEST and u.min() > 0.0):
        raise DoesNotSwim(
            f"mean surge speeds are {np.round(u, 3).tolist()} m/s; expected all above 0"
        )
    powers = np.column_stack([u, u * np.abs(u)])
    (a, b), _ = nnls(powers[straight], swims.throttle[straight])
    turns = ~straight
    more = swims.throttle[turns] - powers[turns] @ [a, b]
    (c, d), _ = nnls(alpha[turns, None] ** 2 * powers[turns], more)
    kappa = swims.yaw_rate[turns] / u[turns]
    gain = float(kappa @ alpha[turns] / (kappa @ kappa))
    if gain <= 0.0:
        raise DoesNotSwim(
            f"a rudder to the left turns to the right: alpha = {gain:.3f} m kappa; expected a gain above 0"
        )
    (a_0, a_1), _ = nnls(np.column_stack([kappa, u[turns] * kappa]), -swims.sway[turns] / u[turns])
    limits = replace(
        law.limits,
        throttle_linear=float(a),
        throttle_quadratic=float(b),
        turn_linear=float(c),
        turn_quadratic=float(d),
        curvature_gain=gain,
    )
    return replace(
        law,
        limits=limits,
        guidance=replace(law.guidance, slip_arm=float(a_0), slip_time=float(a_1)),
    )
