# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old the camera's images are and how far its clock is from the IMU's, from recordings, with standard deviations.

The heading that the camera saw is compared with that of the IMU. What is printed as offset belongs into the parameter
camera_offset of node fusion, which also finds it while it runs. An IMU that computes an orientation may report it earlier
or later than its gyro: the lead of the heading on the gyro is printed too, and the offset to the gyro's clock, which is the
offset plus the lead. Exit status 1: no recording says it for sure.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fish_bag import Trial, find_trials, read_trial
from fish_bag.topic_map import TopicMap, add_topic_arguments, topic_map
from fish_control.fusion_config import FusionConfig
from fish_control.imu_heading import HeadingNoise, ImuHeading, against_gyro
from fish_control.offset_sums import ClockEstimate
from fish_control.recorded_offset import RecordedOffset, pooled, recorded_offset
from fish_report.errors import UserError
from fish_report.files import named_path
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
    found, left_out = all_measured(find_trials(recording), topic_map(args))
    for why in left_out:
        say(terminal(stderr=True), f"left out: {why}")
    if not found:
        raise UserError(f"{recording}: expected a recording with imu/data and camera/pose")
    print_table(terminal(), table(found))
    sure = [m.recorded.estimate for _, m in found if m.recorded.estimate.sure]
    if not sure:
        say(terminal(), "not sure: the fish must swim and turn while both sensors measure")
        return 1
    say(terminal(), f"camera_offset: {together(sure)}")
    to_gyro = [m.to_gyro for _, m in found if m.to_gyro.sure]
    if to_gyro:
        say(terminal(), f"to the gyro's clock: {together(to_gyro)}")
    return 0


def all_measured(
    paths: Sequence[Path], topics: TopicMap | None
) -> tuple[list[tuple[str, Measured]], list[str]]:
    """Names and answers of the recordings that have both sensors, and why the others are left out."""
    found, left_out = [], []
    for path in paths:
        try:
            trial = read_trial(path, topics)
            found.append((trial.name, measured(trial)))
        except (UserError, ValueError) as error:
            left_out.append(str(error))
    return found, left_out


class Measured(NamedTuple):
    """What one recording says."""

    recorded: RecordedOffset  # to the clock of the heading that fusion uses
    lead: ClockEstimate  # of that heading on the gyro

    @property
    def to_gyro(self) -> ClockEstimate:
        """The offset to the gyro's clock."""
        return against_gyro(self.recorded.estimate, self.lead)


def together(estimates: list[ClockEstimate]) -> str:
    """The mean of all recordings, and how much they differ."""
    mean = pooled(estimates)
    text = f"{mean.offset:.4f} +- {mean.std:.4f} s"
    if mean.between > 0.0:
        text += f"; the recordings differ by {mean.between:.4f} s (standard deviation) beyond their errors"
    return text


def measured(trial: Trial) -> Measured:
    """Offset and lead of one recording.

    Raises:
        ValueError: a sensor is missing, or its values are.
    """
    if trial.imu is None or trial.camera is None:
        missing = "imu/data" if trial.imu is None else "camera/pose"
        raise ValueError(f"{trial.name}: no {missing}: expected both sensors")
    imu, camera = trial.imu.clean(), trial.camera.clean()
    noise = FusionConfig()
    heading = ImuHeading(
        HeadingNoise(noise.gyro_noise, noise.gyro_drift, noise.coasting_yaw_rate, REACH), math.inf
    )
    yaw = [
        heading.add(float(t), _given(rate), _given(turned)).yaw
        for t, rate, turned in zip(imu.t, imu.gyro[:, 2], yaws(imu.orientation), strict=True)
    ]
    delay = float(np.median(imu.t_arrival - imu.t)) if len(imu) else 0.0
    latencies = camera.t_arrival - camera.t - delay
    found = recorded_offset(camera.t, camera.psi, latencies, imu.t, np.array(yaw))
    return Measured(found, heading.lead)


def yaws(quaternions: np.ndarray) -> np.ndarray:
    """Rotation about z (N,) [rad] of quaternions x, y, z, w; NaN where they are."""
    x, y, z, w = quaternions.T
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _given(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def table(found: list[tuple[str, Measured]]) -> Table:
    """One row for each recording."""
    rows = []
    for name, m in found:
        e, offset = m.recorded.estimate, m.recorded
        spread = [b.offset for b in offset.blocks]
        parts = f"{min(spread):.3f} to {max(spread):.3f}" if spread else "-"
        gyro = [f"{m.to_gyro.offset:.4f}", f"{m.to_gyro.std:.4f}"] if m.lead.sure else ["-", "-"]
        lead = f"{m.lead.offset:.4f}" if m.lead.sure else "-"
        rows.append(
            [name, f"{e.offset:.4f}", f"{e.std:.4f}", "yes" if e.sure else "no", lead, *gyro]
            + [f"{offset.age:.3f}", parts, str(offset.pairs)]
        )
    header = ["recording", "offset s", "+-", "sure", "lead s", "to gyro s", "+-"]
    header += ["age s", "parts s", "pairs"]
    note = (
        "Offset: added to the camera's stamps, to the clock of the IMU's heading. Lead: of that heading on the gyro. "
        "To gyro: offset to the gyro's clock. Age: of an image when its pose arrives, by the newest stamp of the IMU, which is a "
        "little old itself. Parts: of 5 s each."
    )
    return Table("Camera and IMU", header, rows, note)
