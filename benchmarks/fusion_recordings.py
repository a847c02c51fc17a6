# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion over a folder of recordings in the order of arrival; prints a table.

python benchmarks/fusion_recordings.py FOLDER [--imu-x M] [--imu-y M]

A row is a recording: camera poses accepted, refused and repeated, reacquisitions, the camera's offset found (added to its
stamps) with its standard deviation, the same to the gyro's clock, the median age of an image at its arrival, the factors on
the noises given, whether the accelerometer is used and the noise of the acceleration per sample, and the robust RMS distance
[mm] and angle [degrees] between a pose that arrives and what was published for its moment before.
Exit status 2: the folder is absent or holds no recordings.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from fish_bag import Trial, find_trials, read_trial
from fish_control.fusion import Fusion
from fish_control.fusion_config import FusionConfig
from fish_control.imu_heading import against_gyro

HEADER = (
    "recording     poses accepted  refused repeated reacquired   offset +- std  to gyro +- std"
    "    age   noise x  accel m/s^2      mm degrees"
)


def events(trial: Trial) -> list[tuple[float, str, int]]:
    """(arrival, kind, index) in the order of arrival."""
    rows = []
    for kind, stream in (("imu", trial.imu), ("camera", trial.camera)):
        if stream is not None:
            rows += [(float(t), kind, i) for i, t in enumerate(stream.t_arrival)]
    return sorted(rows)


def yaw(q: np.ndarray) -> float | None:
    """Rotation about z [rad] of a quaternion x, y, z, w; None where it was not measured."""
    x, y, z, w = map(float, q)
    if not math.isfinite(x + y + z + w):
        return None
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def fuse(trial: Trial, config: FusionConfig) -> tuple[str, Counter[str]]:
    """One row of the table, and what became of the poses."""
    fusion, published, errors = Fusion(config), [], []
    imu, camera = trial.imu, trial.camera
    assert camera is not None
    for _, kind, i in events(trial):
        if kind == "imu" and imu is not None:
            rate, force = imu.gyro[i, 2], imu.accel[i]
            known = [None if not math.isfinite(v) else float(v) for v in (rate, *force[:2])]
            fusion.add_imu(float(imu.t[i]), *known, yaw(imu.orientation[i]))
            estimate = fusion.estimate()
            if estimate is not None and not estimate.imu_lost:
                published.append((estimate.time, *estimate.pose))
            continue
        fusion.add_pose(float(camera.t[i]), camera.pose[i], camera.covariance[i])
        time = float(camera.t[i]) + fusion.applied_offset
        if (
            fusion.camera_clock.current.sure
            and published
            and published[0][0] <= time <= published[-1][0]
        ):
            rows = np.array(published[-400:])
            rows[:, 3] = np.unwrap(rows[:, 3])
            at = [np.interp(time, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]
            errors.append(
                (
                    *(camera.pose[i, :2] - at[:2]),
                    math.remainder(camera.pose[i, 2] - at[2], 2 * math.pi),
                )
            )
    counts = fusion.counts
    counts["fused"] = counts["pose"] + counts["started"] * config.start_frames
    counts["came"] = len(camera)
    return row(trial.name, fusion, np.array(errors).reshape(-1, 3)), counts


def row(name: str, fusion: Fusion, errors: np.ndarray) -> str:
    """A line of text."""
    clock, counts = fusion.camera_clock, fusion.counts
    poses, share = counts["came"], 100 * counts["fused"] / counts["came"]
    to_gyro = against_gyro(clock.current, fusion.imu_heading.lead)
    square = np.median(np.square(errors), axis=0) / 0.455 if len(errors) else np.full(3, np.nan)
    return (
        f"{name:12s} {poses:6d} {share:8.1f} {counts['pose_outlier']:8d} {counts['pose_repeated']:8d} "
        f"{counts['reacquired']:10d} {clock.current.offset:8.3f} +- {clock.current.std:.3f} "
        f"{to_gyro.offset:8.3f} +- {to_gyro.std:.3f} {clock.age:6.3f} "
        f"{motion(fusion)} "
        f"{1e3 * math.sqrt(square[0] + square[1]):8.1f} {math.degrees(math.sqrt(square[2])):6.2f}"
    )


def motion(fusion: Fusion) -> str:
    """Factors on the standard deviations of positions and headings, and what is known of the acceleration."""
    scale, model = fusion.noise_scale, fusion.motion_model
    factors = f"{math.sqrt(scale.position):5.2f} {math.sqrt(scale.heading):5.2f}"
    return f"{factors} {'used' if model.accel_used else 'unused':>6s} {model.accel_noise:5.2f}"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--imu-x", type=float, default=0.0, help="m, IMU ahead of the head's centre"
    )
    parser.add_argument("--imu-y", type=float, default=0.0, help="m, and to the left of it")
    args = parser.parse_args()
    folder, config = args.folder, FusionConfig(imu_x=args.imu_x, imu_y=args.imu_y)
    trials = find_trials(folder) if folder.is_dir() else []
    if not trials:
        print(
            f"{folder}: absent or without recordings; expected a folder of recordings",
            file=sys.stderr,
        )
        return 2
    print(HEADER)
    total: Counter[str] = Counter()
    for path in trials:
        text, counts = fuse(read_trial(path), config)
        total += counts
        print(text, flush=True)
    share = 100 * total["fused"] / total["came"]
    print(f"all          {total['came']:6d} {share:8.1f} {total['pose_outlier']:8d}", end="")
    print(f" {total['pose_repeated']:8d} {total['reacquired']:10d}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
