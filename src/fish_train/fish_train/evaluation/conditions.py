# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The conditions robots are judged under, by name and from the command line."""

from __future__ import annotations

from dataclasses import replace

from fish_sim.robot import Robot
from fish_sim.sensors.settings import SensorSettings
from fish_train.evaluation.study import Condition

ROBUST_OFF = 0.3  # of the uncertain parameters
ROBUST_LATENCY = 0.3  # s, of the camera
ROBUST_CURRENT = 0.03  # m/s, across the pool's long side


def make_condition(
    robot: Robot,
    off: float = 0.0,
    current: float = 0.0,
    latency: float | None = None,
    perfect: bool = False,
) -> Condition:
    """A named condition; what is not given stays as in the simulator node.

    Raises:
        ValueError: a value out of range; says what came and what was expected.
    """
    if not 0.0 <= off < 1.0:
        raise ValueError(f"off: got {off:g}; expected a share from 0 to below 1 (0.3 is 30 %)")
    parts = [robot.name if robot != Robot() else "nominal"]
    if perfect:
        parts.append("perfect state" if current else "perfect state, still water")
    if off:
        parts.append(f"parameters off by up to {off:.0%}")
    if current:
        robot = robot.with_effect("current", x=0.0, y=current)
        parts.append(f"current {current:g} m/s")
    sensors = SensorSettings()
    if latency is not None:
        sensors = replace(sensors, camera_latency=latency)
        parts.append(f"camera latency {latency:g} s")
    return Condition(
        name=", ".join(parts),
        robot=robot,
        off=off,
        fused=not perfect,
        sensors=sensors,
        disturbance=0.0 if perfect else Condition.disturbance,
    )


def robust_conditions(robot: Robot) -> list[Condition]:
    """Nominal, and one thing wrong at a time."""
    return [
        make_condition(robot),
        make_condition(robot, off=ROBUST_OFF),
        make_condition(robot, latency=ROBUST_LATENCY),
        make_condition(robot, current=ROBUST_CURRENT),
    ]
