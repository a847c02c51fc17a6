# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Diagnose the recordings of this example and draw what was found: docs/_static/hidden_drag.svg.

python examples/hidden_drag/picture.py [--out docs/_static/hidden_drag.svg]      (half a minute; needs requirements-bench.txt)
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fish_bag import read_dataset
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import build_experiment
from fish_sysid.diagnosis.pipeline import diagnose
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.reports.diagnosis_figures import binned_means
from fish_sysid.reports.identify_page import whole_swims

EFFECT = "quadratic_drag"  # concealed in these recordings
SHOWN = 8  # names of the evidence
BEFORE, AFTER, NEUTRAL = "tab:blue", "tab:orange", "0.5"


def picture(found: Diagnosis) -> Figure:
    """Where the mismatch is, which name explains it, and what held-out trials gain."""
    figure = Figure(figsize=(11.0, 3.4), layout="constrained")
    force, names, error = figure.subplots(1, 3)
    draw_missing_force(force, found)
    draw_evidence(names, found)
    draw_held_out_trials(error, found)
    for axes in (force, names, error):
        axes.grid(color="0.9")
        axes.set_axisbelow(True)
    return figure


def draw_missing_force(axes: Axes, found: Diagnosis) -> None:
    """Yaw moments over the yaw rate: what the effect does, and what of it refitted parameters do not absorb."""
    for force, label, colour in (
        (found.pushes[EFFECT], "the effect's own moment", AFTER),
        (found.force, "missing in the refitted model", BEFORE),
        (found.remaining, "missing with the effect", NEUTRAL),
    ):
        rate, moment = binned_means(
            force.covariates["yaw_rate"].ravel(), force.wrench[..., 2].ravel()
        )
        axes.plot(rate, 1e3 * moment, ".-", label=label, color=colour)
    axes.set(title="where", xlabel="yaw rate, rad/s", ylabel="yaw moment, mN m")
    axes.legend(fontsize="small")


def draw_evidence(axes: Axes, found: Diagnosis) -> None:
    """By how much the log-likelihood of each name's quick fit is behind that of the best."""
    nearest = sorted(found.state.rounds[0].ranking, key=lambda ranked: -ranked.gain)[:SHOWN][::-1]
    best = nearest[-1].gain
    axes.plot(
        [best - ranked.gain for ranked in nearest],
        [ranked.name for ranked in nearest],
        "o",
        color=BEFORE,
    )
    axes.plot(0.0, nearest[-1].name, "o", color=AFTER)
    axes.set(title="which", xlabel="behind the best name, nats")


def draw_held_out_trials(axes: Axes, found: Diagnosis) -> None:
    """Distance between measured and simulated position of every held-out trial, from its first estimate on, not corrected."""
    trials = found.task.experiment.select(found.task.split.held_out)
    for fit, label, colour in (
        (found.nominal, "refitted model", BEFORE),
        (found.final, "with the effect", AFTER),
    ):
        for swim in whole_swims(trials, fit):
            away = np.linalg.norm(swim.simulated[:, :2] - swim.measured[:, :2], axis=1)
            axes.plot(swim.t, 1e3 * away, color=colour, label=label)
            label = None  # one entry of the legend for all trials
    axes.set(
        title="how much: held-out trials", xlabel="simulated for, s", ylabel="position error, mm"
    )
    axes.legend(fontsize="small")


def main() -> None:
    """Read, diagnose, draw."""
    parser = argparse.ArgumentParser(description="draw the diagnosis of this example")
    parser.add_argument(
        "--out", type=Path, default=Path("docs/_static/hidden_drag.svg"), help="picture to write"
    )
    out = parser.parse_args().out
    trials = list(read_dataset(Path(__file__).parent / "recordings"))
    found = diagnose(build_experiment(trials), Robot(), progress=print)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "hidden_drag"}):
        picture(found).savefig(out, metadata={"Date": None} if out.suffix == ".svg" else None)
    print(f"wrote {out}")


if __name__ == "__main__":
    main()
