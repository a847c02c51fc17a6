# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old the camera's images are and how far its clock is from the IMU's, from recordings, with standard deviations.

The heading that the camera saw is compared with that of the IMU. What is printed as offset belongs into the parameter
camera_offset of node fusion, which also finds it while it runs. Exit status 1: no recording says it for sure.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from fish_bag import Trial, find_trials, read_trial
from fish_bag.topic_arguments import add_topic_arguments, topic_map
from fish_control.fusion_config import FusionConfig
from fish_control.imu_heading import HeadingNoise, ImuHeading
from fish_control.recorded_offset import RecordedOffset, recorded_offset
from fish_report.errors import UserError, user_errors
from fish_report.named_path import named_path
from fish_report.page import Table
from fish_report.terminal import print_table, say, terminal

REACH = 0.25  # s, longer gaps between IMU samples are unknown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("recording", type=Path, help="a recording, or a folder of recordings")
    add_topic_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Print a table, and what all that are sure say together."""
    recording = named_path(args.recording)
    trials = [read_trial(path, topic_map(args)) for path in find_trials(recording)]
    if not trials:
        raise UserError(f"{recording}: expected a recording with imu/data and camera/pose")
    found = []
    for trial in trials:
        with user_errors():
            found.append((trial.name, measured(trial)))
    print_table(terminal(), table(found))
    sure = [offset.estimate for _, offset in found if offset.estimate.sure]
    if not sure:
        say(terminal(), "not sure: the fish must swim and turn while both sensors measure")
        return 1
    weight = np.array([1.0 / e.std**2 for e in sure])
    mean = float(weight @ [e.offset for e in sure] / weight.sum())
    say(terminal(), f"camera_offset: {mean:.4f} +- {math.sqrt(1.0 / weight.sum()):.4f} s")
    return 0


def measured(trial: Trial) -> RecordedOffset:
    """The offset of one recording.

    Raises:
        ValueError: a sensor is missing, or its values are.
    """
    if trial.imu is None or trial.camera is None:
        missing = "imu/data" if trial.imu is None else "camera/pose"
        raise ValueError(f"{trial.name}: no {missing}: expected both sensors")
    imu, camera = trial.imu.clean(), trial.camera.clean()
    noise = FusionConfig()
    heading = ImuHeading(
        HeadingNoise(noise.gyro_noise, noise.gyro_drift, noise.coasting_yaw_rate, REACH)
    )
    yaw = [
        heading.add(float(t), _given(rate), _given(turned)).yaw
        for t, rate, turned in zip(imu.t, imu.gyro[:, 2], yaws(imu.orientation), strict=True)
    ]
    delay = float(np.median(imu.t_arrival - imu.t)) if len(imu) else 0.0
    latencies = camera.t_arrival - camera.t - delay
    return recorded_offset(camera.t, camera.psi, latencies, imu.t, np.array(yaw))


def yaws(quaternions: np.ndarray) -> np.ndarray:
    """Rotation about z (N,) [rad] of quaternions x, y, z, w; NaN where they are."""
    x, y, z, w = quaternions.T
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _given(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def table(found: list[tuple[str, RecordedOffset]]) -> Table:
    """One row for each recording."""
    rows = []
    for name, offset in found:
        e = offset.estimate
        spread = [b.offset for b in offset.blocks]
        parts = f"{min(spread):.3f} to {max(spread):.3f}" if spread else "-"
        rows.append(
            [name, f"{e.offset:.4f}", f"{e.std:.4f}", f"{offset.age:.3f}", parts, str(offset.pairs)]
            + ["yes" if e.sure else "no"]
        )
    header = ["recording", "offset s", "+-", "age s", "parts s", "pairs", "sure"]
    note = "Offset: added to the camera's stamps. Age: of an image when its pose arrives. Parts: of 5 s each."
    return Table("Camera and IMU", header, rows, note)
