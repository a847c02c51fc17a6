# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Do bands of predictions mean what they say where the structure is wrong? Another fish, fitted by one link.

python benchmarks/wrong_structure.py --repetitions 5 [--plant mujoco]

Every repetition draws a fish, swims it, fits a robot of one link without effects to eight trials, and predicts four others.
links: three links (drags, stiffness and added masses within 30 %) and a sliding tip. mujoco: the second plant of the studies,
five elastic joints in another water (stiffness and inertias within 30 %); needs `make install/.studies`. Prints the share of
predictions at 1 s inside their 95 % bands, of position, heading and speed.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.water_push import USUAL_SIZE
from fish_sysid.coverage import SPREAD, draw_truth
from fish_sysid.dataset.experiment import Experiment, Headings
from fish_sysid.dataset.synthetic import KINDS, program, record, sensed
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE
from fish_sysid.estimation.shooting.prediction_fit import fit_predictions, inside
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
    parser.add_argument("--plant", choices=("links", "mujoco"), default="links")
    args = parser.parse_args()
    shares = []
    for seed in range(args.seed, args.seed + args.repetitions):
        began = time.process_time()
        experiment = swum(seed, args.duration, args.plant)
        training = experiment.select(range(SEEN))
        unseen = experiment.select(range(SEEN, TRIALS))
        fit = fit_predictions(training, Robot(), NOMINAL_FREE, links=(1,))
        found = fit.found
        good = inside(
            multistep(training, found),
            multistep(unseen, found),
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


def swum(seed: int, duration: float, plant: str) -> Experiment:
    """Trials of a fish that no robot of one link is, with the IMU's orientation."""
    random = np.random.default_rng(seed)
    kinds = [KINDS[m % len(KINDS)] for m in range(TRIALS)]
    if plant == "mujoco":
        commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
        made, heading = swum_in_mujoco(seed, commands, random)
    else:
        truth = draw_truth(random).with_effect("tip_slip", mobility=random.uniform(0.1, 0.4))
        commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
        made, true = record(truth, commands, Noise(wrench=USUAL_SIZE), random)
        heading = true.state[..., 2]
    t = DT * np.arange(made.length)
    headings = tuple(
        Headings(t, heading[:, m] + DRIFT * random.standard_normal(len(t)) + random.uniform(-3, 3))
        for m in range(TRIALS)
    )
    return replace(made, headings=headings)


def swum_in_mujoco(
    seed: int, commands: np.ndarray, random: np.random.Generator
) -> tuple[Experiment, np.ndarray]:
    """(recordings, true headings (T, M)) of the second plant under commands (T, M, 2)."""
    from fish_study.mujoco_plant import NOMINAL, MujocoPlant
    from fish_study.scenario import Scenario

    T, M = commands.shape[:2]
    drawn = {name: 1.0 + random.uniform(-SPREAD, SPREAD) for name in NOMINAL}
    scenario = Scenario("mujoco", seed, {}, parameters=drawn, count=M, plant="mujoco", links=5)
    plant = MujocoPlant.of(scenario, M, random)
    pose, rotor, felt = np.zeros((T, M, 3)), np.zeros((T, M)), np.zeros((T, 3, M))
    for k in range(T):
        pose[k], rotor[k] = plant.pose, plant.rotor_speed
        felt[k] = plant.step(commands[k])
    accel = felt[:, 1:].transpose(0, 2, 1)
    return sensed(commands, pose, felt[:, 0], accel, rotor, Noise(), random)[0], pose[..., 2]


if __name__ == "__main__":
    main()
