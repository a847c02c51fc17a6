# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much of each effect single recordings seem to have where nothing changed, and what that leaves of a typical change.

python src/fish_sysid/benchmarks/run_to_run.py FOLDER [--new 4]

Each trial in turn is NEW against all others. The spread of its strengths, in typical ones, says by how many standard errors a
typical change stands out when `--new` trials are compared with the rest.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from fish_report.page import Table
from fish_report.terminal import print_table, terminal
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import align, moved_back
from fish_sysid.dataset.read import read_experiment
from fish_sysid.dataset.synthetic import INJECTIONS
from fish_sysid.diagnosis.change.channels import swims
from fish_sysid.diagnosis.change.compare import LOOKS
from fish_sysid.diagnosis.change.explanation import NAMES
from fish_sysid.diagnosis.change.naming import strength_of
from fish_sysid.diagnosis.change.rows import look, trial_rows
from fish_sysid.diagnosis.change.servos import OldAnswer
from fish_sysid.diagnosis.change.shared_fit import regression, settled


def main() -> None:
    """One row for each of the effects that can be put into recordings exactly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--new", type=int, default=4, help="trials of NEW (default 4)")
    args = parser.parse_args()
    experiment, _ = read_experiment(args.dataset)
    experiment = moved_back(experiment, align(experiment).delay)
    days = swims(experiment)
    whole = trial_rows(Robot(), experiment, days, NAMES)
    whole = OldAnswer.of(whole).added(whole, days, experiment)
    shown = {}
    for name, channels in LOOKS.items():
        rows = look(whole, channels)
        known = settled(rows)
        fits = [regression([*rows[:m], *rows[m + 1 :]], [rows[m]], known) for m in range(len(rows))]
        for effect in INJECTIONS:
            of_runs = [strength_of(fit, (effect, 0))[0] for fit in fits]
            shown[effect, name] = float(np.std(of_runs, ddof=1))
    of_mean = np.sqrt(1.0 / args.new + 1.0 / (len(days) - args.new))
    cells = [
        [
            effect,
            *(f"{shown[effect, n]:.2f}, {1.0 / (shown[effect, n] * of_mean):.1f}" for n in LOOKS),
        ]
        for effect in INJECTIONS
    ]
    note = "Spread from run to run, in typical strengths; a typical change in standard errors."
    print_table(terminal(), Table("From run to run", ["effect", *LOOKS], cells, note))


if __name__ == "__main__":
    main()
