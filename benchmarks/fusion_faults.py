# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion of the simulated fish while sensors fall silent and clocks are set; prints a table.

python benchmarks/fusion_faults.py [--seeds 2] [--only NAME ...]

The fish swims open loop for 32 s, the camera is 0.1 s late, no offset is given. The fault comes at 12 s. A row is a fault:
largest error of the estimate's position against the simulator's truth at its stamp from then on [mm] and the standard
deviation claimed there, how long after the fault's end the error stays below 5 mm for good [s], RMS over the last 5 s [mm],
and what the fusion counted: clocks set, starts anew, poses that waited for a clock, reacquisitions. Worst of the seeds.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from fusion_latency import POSE_COVARIANCE, REST, Stream, swim
from numpy.typing import NDArray

from fish_control.fusion import Fusion

Array = NDArray[np.float64]
SECONDS, FAULT, LATENCY = 32.0, 12.0, 0.1
SILENCE = 10.0  # s
GOOD = 0.005  # m
Clocks = Callable[
    [float, str], float | None
]  # true time, sensor -> by how much its clock is ahead; None: it is silent


@dataclass(frozen=True)
class Fault:
    """What is wrong when, and when it is over."""

    clocks: Clocks
    over: float = FAULT  # s


def silent(*sensors: str) -> Fault:
    """Sensors that say nothing for SILENCE."""
    return Fault(
        lambda t, who: None if who in sensors and FAULT <= t < FAULT + SILENCE else 0.0,
        FAULT + SILENCE,
    )


def clock_set(by: float, *sensors: str, at: float = FAULT) -> Fault:
    """Clocks that are set [s] at a time."""
    return Fault(lambda t, who: by if who in sensors and t >= at else 0.0, max(at, REST))


BOTH = ("camera", "imu")
FAULTS = {
    "camera silent for 10 s": silent("camera"),
    "imu silent for 10 s": silent("imu"),
    "both silent for 10 s": silent(*BOTH),
    **{f"both clocks {by:+g} s": clock_set(by, *BOTH) for by in (0.3, 60.0, 3600.0)},
    **{f"both clocks {by:+g} s": clock_set(by, *BOTH) for by in (-0.05, -0.3, -1.0, -5.0)},
    **{
        f"camera's clock {by:+g} s at first": clock_set(by, "camera", at=-math.inf)
        for by in (1.0, -1.0)
    },
    **{
        f"camera's clock {by:+g} s": clock_set(by, "camera")
        for by in (0.15, 0.3, 1.0, -0.15, -0.3, -1.0)
    },
    **{f"imu's clock {by:+g} s": clock_set(by, "imu") for by in (0.22, -0.22)},
}


def events(stream: Stream, clocks: Clocks) -> Iterator[tuple[float, str, float, Array]]:
    """(true time of arrival, sensor, stamp, values) in the order of arrival; silent sensors are left out."""
    rows = [(t, "imu", t, values) for t, *values in stream.imu.tolist()]
    rows += [(t + LATENCY, "camera", t, values) for t, *values in stream.camera.tolist()]
    for arrival, sensor, taken, values in sorted(rows, key=lambda row: row[0]):
        ahead = clocks(taken, sensor)
        if ahead is not None:
            yield arrival, sensor, taken + ahead, values


@dataclass(frozen=True)
class Score:
    """Errors of one run."""

    largest: float  # m
    claimed: float  # m, there
    again: float  # s after the fault's end
    last: float  # m, RMS over the last 5 s
    counts: tuple[int, ...]


def fuse(stream: Stream, fault: Fault) -> Score:
    """Feed a run; the estimates are compared at every sample and pose that arrives."""
    fusion, rows, clocks = Fusion(), [], {"camera": 0.0, "imu": 0.0}
    times = stream.imu[:, 0]
    for arrival, sensor, stamp, values in events(stream, fault.clocks):
        if sensor == "imu":
            used = fusion.add_imu(stamp, *values[:3])
        else:
            used = True
            fusion.add_pose(stamp, values, POSE_COVARIANCE)
        if used:  # until its stamps are believed, an IMU whose clock was set leaves the estimate at the clock before
            clocks[sensor] = fault.clocks(arrival, sensor) or 0.0
        estimate = fusion.estimate() if arrival >= FAULT else None
        if estimate is None:
            continue
        # without the IMU the estimate has the camera's clock
        ahead = clocks["camera" if estimate.imu_lost else "imu"]
        true = [np.interp(estimate.time - ahead, times, stream.truth[:, k]) for k in (0, 1)]
        std = math.sqrt(estimate.pose_covariance[0, 0] + estimate.pose_covariance[1, 1])
        rows.append((arrival, math.hypot(*(estimate.pose[:2] - true)), std))
    arrival, error, std = np.array(rows).T
    worst = int(np.argmax(error))
    bad = arrival[error > GOOD]
    clock, counts = fusion.camera_clock, fusion.counts
    return Score(
        float(error[worst]),
        float(std[worst]),
        max(0.0, float(bad[-1]) - fault.over) if len(bad) else 0.0,
        float(np.sqrt(np.mean(error[arrival > SECONDS - 5.0] ** 2))),
        (
            clock.jumps,
            counts["restarted"],
            counts["pose_clock_undecided"],
            counts["reacquired"],
        ),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=FAULTS, default=FAULTS, help="faults")
    args = parser.parse_args()
    streams = [swim(seed, SECONDS) for seed in range(args.seeds)]
    print(f"{'fault':30s} largest claimed  again   last |   set  anew waited reacquired")
    for name in args.only:
        scores = [fuse(stream, FAULTS[name]) for stream in streams]
        worst = max(scores, key=lambda score: score.largest)
        again, last = max(s.again for s in scores), max(s.last for s in scores)
        counts = np.max([s.counts for s in scores], axis=0)
        print(
            f"{name:30s} {1e3 * worst.largest:7.1f} {1e3 * worst.claimed:7.1f} {again:6.2f} {1e3 * last:6.2f} | "
            + " ".join(f"{count:5d}" for count in counts),
            flush=True,
        )


if __name__ == "__main__":
    main()
