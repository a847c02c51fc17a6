# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion of the simulated fish for camera latencies and clock offsets that are not given; prints a table.

python benchmarks/fusion_latency.py [--seeds 3] [--seconds 30]

A row is a latency and an offset. Errors are RMS against the simulator's truth from 10 s of swimming on: position [mm],
heading [degrees], the error of the offset found [ms], the time until it was found [s], the share of instants whose NEES
(3 degrees of freedom) is inside its two-sided 95 % band, and processor time per second of robot time.
"""

from __future__ import annotations

import argparse
import math
import time as clock
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion import Fusion
from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig

Array = NDArray[np.float64]
LATENCIES = (0.1, 0.3, 0.6, 1.0)  # s
OFFSETS = (0.0, 0.05, 0.5)  # s, by which stamps are late
SETTLED = 10.0  # s
REST = 1.0  # s before the first stroke
BAND = (0.2158, 9.348)  # chi^2 of 3, two-sided 95 %
POSE_COVARIANCE = np.diag([0.002**2, 0.002**2, 0.012**2])
FREQUENCY, AMPLITUDE = 2.0, 7.0  # Hz, rad of the rotor


@dataclass(frozen=True)
class Stream:
    """What the sensors of one run measure."""

    imu: Array  # (N, 5) time [s], yaw rate, forward, left, yaw
    camera: Array  # (M, 4) exposure [s], x, y, psi
    truth: Array  # (N, 3) pose at the IMU's times


def swim(seed: int, seconds: float) -> Stream:
    """One open-loop run: rest, then strokes with a rudder that moves slowly."""
    config = SimulationConfig(seed=seed, camera_latency=0.0)
    simulation = Simulation(Robot(), config)
    w = 2.0 * math.pi * FREQUENCY
    imu, camera, truth = [], [], []
    for _ in range(round(100 * seconds)):
        reading = simulation.advance()
        t = reading.time
        sample = reading.imu
        imu.append((t, sample.angular_velocity[2], *sample.specific_force[:2], sample.yaw))
        camera += [(p.stamp, p.x, p.y, p.heading) for p in reading.camera]
        truth.append(reading.truth.pose)
        swims = t >= REST
        rotor = AMPLITUDE * w * math.sin(w * (t - REST)) if swims else 0.0
        rudder = 0.15 + 0.3 * math.sin(0.9 * (t - REST)) if swims else 0.0
        simulation.command(rotor, rudder)
    return Stream(np.array(imu), np.array(camera), np.array(truth))


@dataclass(frozen=True)
class Score:
    """Errors of one run."""

    squares: Array  # (3,) mean squares of x, y [m^2] and psi [rad^2]
    offset_error: float  # s
    found: float  # s, when the offset was first sure
    inside: float  # share of NEES inside the band
    accepted: float  # share of poses
    load: float  # s of processor time per s


def fuse(stream: Stream, latency: float, offset: float, oriented: bool = False) -> Score:
    """Feed a run in the order of arrival."""
    fusion, errors, nees, found = Fusion(), [], [], math.inf
    camera = iter([*stream.camera, [math.inf] * 4])
    pose = next(camera)
    begin = clock.process_time()
    for (t, *sample, yaw), true in zip(stream.imu, stream.truth, strict=True):
        while pose[0] + latency <= t:
            fusion.add_pose(pose[0] + offset, pose[1:], POSE_COVARIANCE)
            pose = next(camera)
        fusion.add_imu(t, *sample, yaw if oriented else None)
        if fusion.camera_clock.current.sure:
            found = min(found, t)
        estimate = fusion.estimate()
        if estimate is None or t < REST + SETTLED:
            continue
        error = estimate.pose - true
        error[2] = math.remainder(error[2], 2.0 * math.pi)
        errors.append(error)
        nees.append(error @ np.linalg.solve(estimate.pose_covariance, error))
    load = (clock.process_time() - begin) / float(stream.imu[-1, 0])
    inside = np.mean((np.array(nees) > BAND[0]) & (np.array(nees) < BAND[1]))
    came = fusion.counts["pose"] + fusion.counts["pose_outlier"]
    return Score(
        np.mean(np.square(errors), axis=0),
        fusion.applied_offset + offset,
        found,
        float(inside),
        fusion.counts["pose"] / max(came, 1),
        load,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--orientation", action="store_true", help="feed the IMU's yaw too")
    args = parser.parse_args()
    streams = [swim(seed, args.seconds) for seed in range(args.seeds)]
    print("latency offset | position heading | offset error found | NEES in band accepted | load")
    print("s       s      | mm       degrees | ms           s     | %            %        | %")
    for latency in LATENCIES:
        for offset in OFFSETS:
            scores = [fuse(s, latency, offset, args.orientation) for s in streams]
            squares = np.mean([s.squares for s in scores], axis=0)
            position, heading = 1e3 * math.sqrt(squares[0] + squares[1]), math.sqrt(squares[2])
            error = 1e3 * max(abs(s.offset_error) for s in scores)
            print(
                f"{latency:<7g} {offset:<6g} | {position:<8.2f} {math.degrees(heading):<7.3f} | "
                f"{error:<12.2f} {max(s.found for s in scores):<5.1f} | "
                f"{100 * np.mean([s.inside for s in scores]):<12.1f} "
                f"{100 * min(s.accepted for s in scores):<8.1f} | "
                f"{100 * np.mean([s.load for s in scores]):.1f}"
            )


if __name__ == "__main__":
    main()
