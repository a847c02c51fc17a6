# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Do bands of predictions mean what they say where the structure is wrong? Three links, fitted by one.

python benchmarks/wrong_structure.py --repetitions 5

Every repetition draws a robot of three links (drags, stiffness and added masses within 30 %) with a sliding tip, swims it, fits a
robot of one link without that effect to eight trials, and predicts four others. Prints the share of predictions at 1 s inside
their 95 % bands, of position, heading and speed.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.coverage import WRENCH, draw_truth
from fish_sysid.dataset.experiment import Experiment, Headings
from fish_sysid.dataset.synthetic import KINDS, program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE
from fish_sysid.estimation.shooting.prediction_band import inside
from fish_sysid.estimation.shooting.prediction_fit import fit_predictions
from fish_sysid.estimation.shooting.schedule import multistep

TRIALS, SEEN = 12, 8
HORIZON = 1.0  # s
DRIFT = 0.003  # rad, noise of the IMU's orientation
QUANTITIES = ("x", "y", "heading", "speed")


def main() -> None:
    """Print a line per repetition and the shares over all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--duration", type=float, default=12.0, help="s of each trial")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    shares = []
    for seed in range(args.seed, args.seed + args.repetitions):
        began = time.process_time()
        experiment = swum(seed, args.duration)
        training = experiment.select(range(SEEN))
        unseen = experiment.select(range(SEEN, TRIALS))
        fit = fit_predictions(training, Robot(), NOMINAL_FREE, links=(1,))
        found = fit.found
        good = inside(
            multistep(training, found.hypothesis, found.z),
            multistep(unseen, found.hypothesis, found.z),
            found.z,
            fit.covariance,
            HORIZON,
        )
        shares.append(good.mean(axis=0))
        print(
            seed,
            said(shares[-1]),
            f"{len(good)} predictions, {time.process_time() - began:.0f} s of CPU",
            flush=True,
        )
        spread = np.std(shares, axis=0) / np.sqrt(len(shares))
        print("all", said(np.mean(shares, axis=0)), "standard errors", said(spread), flush=True)


def said(shares: np.ndarray) -> str:
    """Shares in words."""
    return ", ".join(
        f"{name} {100 * share:.1f} %" for name, share in zip(QUANTITIES, shares, strict=True)
    )


def swum(seed: int, duration: float) -> Experiment:
    """Trials of a robot of three links whose tip slides."""
    random = np.random.default_rng(seed)
    truth = draw_truth(random).with_effect("tip_slip", mobility=random.uniform(0.1, 0.4))
    kinds = [KINDS[m % len(KINDS)] for m in range(TRIALS)]
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    made, true = record(truth, commands, Noise(wrench=WRENCH), random)
    t = DT * np.arange(made.length)
    headings = tuple(
        Headings(
            t, true.state[:, m, 2] + DRIFT * random.standard_normal(len(t)) + random.uniform(-3, 3)
        )
        for m in range(TRIALS)
    )
    return replace(made, headings=headings)


if __name__ == "__main__":
    main()
