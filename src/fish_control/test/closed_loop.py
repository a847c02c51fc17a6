# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion, planner and controller around the simulated fish with its noisy, delayed sensors; no ROS."""

from dataclasses import dataclass

import numpy as np

from fish_control.controller import Command, Controller, Reference
from fish_control.fusion import Fusion, FusionConfig
from fish_control.line_of_sight import GuidanceConfig, Motion
from fish_control.path_batch import TrackerConfig
from fish_control.path_tracker import PathTracker
from fish_control.planner import Planner
from fish_control.policy import Policy
from fish_control.reference_path import ReferencePath
from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig

DT = 0.01  # s
RUN_UP = 0.15  # m, start this far before the path


@dataclass(frozen=True)
class Score:
    """Errors of the true fish, after the approach: from when it is within 0.05 m and 20 % of the speed."""

    finished: bool
    cross_track_rmse: float  # m
    cross_track_max: float  # m
    speed_rmse: float  # m/s
    rudder_rate: float  # rad/s, RMS
    estimate_rmse: float  # m, position error of the fusion
    approach: float  # s


def swim(
    path: ReferencePath,
    speed: float,
    policy: Policy,
    *,
    robot: Robot | None = None,
    start: tuple[float, float, float] | None = None,
    seed: int = 1,
    guidance: GuidanceConfig | None = None,
    tracker: TrackerConfig | None = None,
    fusion: FusionConfig | None = None,
    record: list | None = None,
    **sensors: float,
) -> Score:
    """Swim the path from rest once; `sensors` are fields of SimulationConfig."""
    p, h = path.point(0.0), float(path.heading_at(0.0))
    x, y, heading = start or (p[0] - RUN_UP * np.cos(h), p[1] - RUN_UP * np.sin(h), h)
    config = SimulationConfig(start_x=x, start_y=y, start_heading=heading, seed=seed, **sensors)
    simulation = Simulation(robot or Robot(), config)
    estimator, planner = Fusion(fusion), Planner(path, speed, tracker, guidance)
    controller, judge = Controller(policy), PathTracker(path, tracker)
    rows = []
    for k in range(int(100 * (1.3 * (path.length + RUN_UP) / speed + 8.0))):
        reading = simulation.advance()
        for pose in reading.camera:
            estimator.add_pose(pose.stamp, np.array([pose.x, pose.y, pose.heading]))
        imu = reading.imu
        estimator.add_imu(reading.time, imu.angular_velocity[2], *imu.specific_force[:2])
        estimate = estimator.estimate()
        if estimate is None:
            continue
        motion = Motion(*map(float, (*estimate.pose, *estimate.twist)))
        planner.observe(reading.time, motion)
        controller.observe(reading.time, motion)
        if k % 2 == 0:
            plan = planner.plan(motion)
            if planner.finished:
                break
            errors = plan.errors
            controller.decide(
                Reference(errors.course, plan.speed, plan.yaw_rate, errors.cross_track)
            )
        command: Command = controller.command(DT)
        simulation.command(command.rotor_speed, command.alpha)
        truth = reading.truth
        at = judge.update(truth.pose[:2])
        off = np.hypot(*(np.array(truth.pose[:2]) - estimate.pose[:2]))
        row = (
            at.progress,
            at.cross_track_error,
            speed - truth.velocity[0],
            command.alpha,
            off,
            reading.time,
        )
        rows.append(row)
        if record is not None:
            record.append((*row, *truth.pose, command.rotor_speed, errors.heading))
    return score(np.array(rows), speed, planner.finished)


def score(rows: np.ndarray, speed: float, finished: bool) -> Score:
    """Rows of progress, cross-track error, speed error, rudder, estimate error, time."""
    near = (np.abs(rows[:, 1]) < 0.05) & (np.abs(rows[:, 2]) < 0.2 * speed) & (rows[:, 0] > 0.0)
    first = int(np.argmax(near)) if near.any() else 0
    after = rows[first:]
    return Score(
        finished,
        rms(after[:, 1]),
        float(np.abs(after[:, 1]).max()),
        rms(after[:, 2]),
        rms(np.diff(after[:, 3]) / DT),
        rms(after[:, 4]),
        float(rows[first, 5] - rows[0, 5]),
    )


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
