# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How old the camera's images are: its heading against the gyro's, for every delay and trial; prints, and draws an SVG.

python benchmarks/camera_delay.py DATASET --out docs/results/camera_delay.svg
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from fish_bag import read_dataset
from fish_sysid.dataset.camera import DELAYS, align, misfits
from fish_sysid.dataset.experiment import Experiment, build_experiment

WIDTH, HEIGHT, LEFT, BOTTOM, MARGIN = 560, 300, 56, 44, 12  # pixels
HIGHEST = 0.3  # rad, top of the axis


def main() -> None:
    """Print the best delay of every trial and of all, draw the curves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--out", type=Path, help="SVG file")
    args = parser.parse_args()
    experiment = build_experiment(list(read_dataset(args.dataset)))
    curves = np.sqrt(misfits(experiment)[0])
    for name, curve in zip(experiment.names, curves, strict=True):
        best = int(np.nanargmin(curve))
        print(
            f"{name:12s} {DELAYS[best]:.2f} s  {curve[best]:.3f} rad instead of {curve[0]:.3f} without a delay"
        )
    found = align(experiment)
    print(
        f"{'all':12s} {found.delay:.2f} s  {found.rms:.3f} rad instead of {found.rms_undelayed:.3f} without a delay"
    )
    if args.out:
        args.out.write_text(drawing(experiment, curves), encoding="utf-8")


def drawing(experiment: Experiment, curves: np.ndarray) -> str:
    """SVG: one line per trial."""
    inner_width, inner_height = WIDTH - LEFT - MARGIN, HEIGHT - BOTTOM - MARGIN

    def x(delay: float) -> float:
        return LEFT + delay / DELAYS[-1] * inner_width

    def y(rms: float) -> float:
        return MARGIN + (1.0 - min(rms, HIGHEST) / HIGHEST) * inner_height

    def text(at: tuple[float, float], words: str, more: str = "") -> str:
        return f'<text x="{at[0]:.0f}" y="{at[1]:.0f}" {more}>{words}</text>'

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for delay in np.arange(0.0, 1.01, 0.2):
        lines.append(text((x(delay), HEIGHT - BOTTOM + 18), f"{delay:.1f}", 'text-anchor="middle"'))
    for rms in np.arange(0.0, HIGHEST + 0.01, 0.1):
        lines.append(text((LEFT - 6, y(rms) + 4), f"{rms:.1f}", 'text-anchor="end"'))
        lines.append(f'<path d="M{LEFT} {y(rms):.1f}H{WIDTH - MARGIN}" stroke="#ddd"/>')
    for name, curve in zip(experiment.names, curves, strict=True):
        points = " ".join(f"{x(d):.1f},{y(r):.1f}" for d, r in zip(DELAYS, curve, strict=True))
        lines.append(
            f'<polyline points="{points}" fill="none" stroke="#4c566a" opacity="0.6"><title>{name}</title></polyline>'
        )
    lines.append(
        text(
            (LEFT + inner_width / 2, HEIGHT - 8),
            "assumed age of the image (s)",
            'text-anchor="middle"',
        )
    )
    lines.append(
        text(
            (14, HEIGHT / 2),
            "rms (rad)",
            f'text-anchor="middle" transform="rotate(-90 14 {HEIGHT / 2})"',
        )
    )
    return "\n".join([*lines, "</svg>\n"])


if __name__ == "__main__":
    main()
