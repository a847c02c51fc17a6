# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion of the simulated fish while clocks are set at random and sensors fall silent around it; prints a table.

python benchmarks/clock_faults.py [--cases 120] [--first 0]

The fish swims open loop for 30 s, in some cases with strokes that change. At 12 s one clock or both are set by up to 0.5 s,
forth or back. Latency (0.1 to 1 s) and offset (0 to 0.5 s) are drawn and not given. For 0.2 to 10 s around that moment the IMU,
the camera, both or none are silent. A row is who was silent: cases, and the seconds in which the estimate is wrong by more than
six of its standard deviations and by more than 20 mm: in all, and the longest of a case.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from fusion_latency import POSE_COVARIANCE, REST, Stream
from numpy.typing import NDArray

from fish_control.fusion import Fusion
from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig

Array = NDArray[np.float64]
SECONDS, SET = 30.0, 12.0
LARGEST = 0.5  # s, by which a clock is set
SIZES = (-0.15, -0.12, -0.08, -0.05, 0.08)  # s, sets that may take one stroke for another
WRONG, STDS = 0.02, 6.0  # m, and standard deviations
LONGEST_STEP = 0.1  # s, counted between two estimates
SILENT = (("imu",), ("camera",), ("imu", "camera"), ())


@dataclass(frozen=True)
class Case:
    """What is wrong in one swim."""

    camera: float  # s, by which the camera's clock is set
    imu: float
    offset: float
    latency: float
    silent: tuple[str, ...]
    hole: tuple[float, float]  # s
    swim: tuple[int, bool]  # seed, whether the strokes change


def drawn(number: int) -> Case:
    """A case; each number is another one."""
    random = np.random.default_rng(7000 + number)
    by = float(random.uniform(-LARGEST, LARGEST))
    if random.random() < 0.5:
        by = float(random.choice(SIZES) + random.normal(0.0, 0.01))
    length = float(np.exp(random.uniform(math.log(0.2), math.log(10.0))))
    start = SET + float(random.uniform(-length - 1.0, 1.0))
    camera, imu = ((by, by), (by, 0.0), (0.0, by))[random.integers(3)]
    offset, latency = float(random.uniform(0.0, 0.5)), float(random.uniform(0.1, 1.0))
    swim = int(random.integers(3)), bool(random.random() < 0.4)
    return Case(camera, imu, offset, latency, SILENT[number % 4], (start, start + length), swim)


@cache
def swum(seed: int, changes: bool) -> Stream:
    """Rest, then strokes; where they change, frequency, amplitude and rudder go to new values every 1.5 s."""
    simulation = Simulation(Robot(), SimulationConfig(seed=seed, camera_latency=0.0))
    random = np.random.default_rng(1000 + seed)
    imu, camera, truth = [], [], []
    phase, stroke = 0.0, np.array([2.0, 7.0, 0.3])  # Hz, rad of the rotor, rad of the rudder
    goal = stroke
    for k in range(round(100 * SECONDS)):
        if changes and k % 150 == 0:
            goal = random.uniform([1.4, 4.0, -0.5], [2.4, 8.0, 0.5])
        stroke = stroke + 0.02 * (goal - stroke)
        reading = simulation.advance()
        t, sample = reading.time, reading.imu
        imu.append((t, sample.angular_velocity[2], *sample.specific_force[:2], sample.yaw))
        camera += [(p.stamp, p.x, p.y, p.heading) for p in reading.camera]
        truth.append(reading.truth.pose)
        frequency, amplitude, rudder = stroke.tolist()
        phase += 2.0 * math.pi * frequency * 0.01
        if t >= REST:
            simulation.command(2.0 * math.pi * frequency * amplitude * math.sin(phase), rudder)
    return Stream(np.array(imu), np.array(camera), np.array(truth))


def seconds_wrong(case: Case) -> float:
    """For how long the estimate is wrong and does not know it [s]."""
    stream, fusion, rows = swum(*case.swim), Fusion(), []
    newest = math.nan  # s, true time of the newest IMU sample in use
    for arrival, who, taken, values in _messages(stream, case.latency):
        if who in case.silent and case.hole[0] <= taken < case.hole[1]:
            continue
        is_set = taken >= SET
        if who == "imu":
            if fusion.add_imu(taken + case.imu * is_set, *values):
                newest = taken
        else:
            stamp = taken + case.camera * is_set + case.offset
            fusion.add_pose(stamp, values, POSE_COVARIANCE)
        estimate = fusion.estimate()
        if estimate is not None and not estimate.imu_lost and arrival > 2.0:
            true = [np.interp(newest, stream.imu[:, 0], stream.truth[:, j]) for j in (0, 1)]
            error = math.hypot(*(estimate.pose[:2] - true))
            std = math.sqrt(np.trace(estimate.pose_covariance[:2, :2]))
            rows.append((arrival, error > max(WRONG, STDS * std)))
    times, wrong = np.array(rows).T
    steps = np.minimum(np.diff(times, append=times[-1]), LONGEST_STEP)
    return float(steps[wrong > 0.0].sum())


def _messages(stream: Stream, latency: float) -> list[tuple[float, str, float, list[float]]]:
    """(arrival, sensor, moment of measurement, values) in the order of arrival."""
    rows = [(t, "imu", t, values) for t, *values, _ in stream.imu.tolist()]
    rows += [(t + latency, "camera", t, values) for t, *values in stream.camera.tolist()]
    return sorted(rows, key=lambda row: row[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=120)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    args = parser.parse_args()
    found: dict[tuple[str, ...], list[float]] = {}
    for number in range(args.first, args.first + args.cases):
        case = drawn(number)
        found.setdefault(case.silent, []).append(seconds_wrong(case))
    print(f"{'silent':14s} cases  wrong, s  longest, s")
    for silent, wrong in found.items():
        who = " and ".join(silent) or "none"
        print(f"{who:14s} {len(wrong):5d}  {sum(wrong):8.1f}  {max(wrong):10.1f}")


if __name__ == "__main__":
    main()
