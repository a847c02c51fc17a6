# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the overhead camera saw of a recorded swim: the fish at several moments, the path it was to follow, the path it swam.

python examples/swim_picture.py out/demo_.../recording --out docs/_static/letter_R.jpg      (a recording of the simulator)
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from fish_bag import RecordingError, read_trial
from fish_bag.trial import Trial
from fish_bringup.score import score_trial
from fish_report.errors import UserError
from fish_sim.camera.config import CameraConfig
from fish_sim.camera.fish import FishPose
from fish_sim.camera.renderer import PoolRenderer

MOMENTS = 6
WANTED, SWUM = (70, 130, 240), (190, 110, 30)  # blue, green, red
FRACTION = 4  # bits of a pixel in the lines


def picture(trial: Trial, renderer: PoolRenderer) -> np.ndarray:
    """(height, width, 3) blue green red: lines on the empty pool, and over them what differs from it at every moment."""
    score = score_trial(trial)
    empty = renderer.render([], 0.0)
    result = empty.copy()
    for points, colour in ((score.path.points, WANTED), (score.position, SWUM)):
        pixels = renderer.camera.project(np.column_stack([points, np.zeros(len(points))]))
        corners = np.round(pixels * (1 << FRACTION)).astype(np.int32)
        cv2.polylines(result, [corners], False, colour, 2, cv2.LINE_AA, FRACTION)
    for moment in np.linspace(score.t[0], score.t[-1], MOMENTS):
        view = renderer.render([pose_at(trial, float(moment))], 0.0)
        fish = (view != empty).any(axis=2)
        result[fish] = view[fish]
    return result


def pose_at(trial: Trial, moment: float) -> FishPose:
    """The head's true pose, with the tail as the tracker saw it."""
    truth, tail = trial.truth, trial.tail
    if truth is None or tail is None:
        raise UserError(
            f"{trial.name}: expected sim/odometry and camera/tail, as a recorded demo has them"
        )
    angles = tuple(float(np.interp(moment, tail.t, angle)) for angle in tail.angle.T)
    x, y, psi = (
        float(np.interp(moment, truth.t, v)) for v in (truth.x, truth.y, np.unwrap(truth.psi))
    )
    return FishPose(x, y, psi, angles)


def main() -> None:
    """Read, draw, write."""
    parser = argparse.ArgumentParser(description="draw a recorded swim of the simulator from above")
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--out", type=Path, default=Path("swim.jpg"), help="picture to write (.jpg)"
    )
    args = parser.parse_args()
    config = CameraConfig()
    # noise would differ everywhere, lamps would hide the lines
    look = replace(config.look(), noise_std=0.0, glare=0.0, jpeg_quality=85)
    renderer = PoolRenderer(config.model(), config.shape(), look)
    try:
        image = picture(read_trial(args.recording).clean(), renderer)
    except (UserError, RecordingError) as error:
        raise SystemExit(str(error)) from error
    args.out.write_bytes(renderer.jpeg(image))
    print(f"wrote {args.out}")


if __name__ == "__main__":
    main()
