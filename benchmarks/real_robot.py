# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs left out of the fit, predicted: ratios to the bilinear baseline on the same windows, and seconds.

python benchmarks/real_robot.py POOL [--leave-out 1] [--effects tip_slip,rudder_gain | choose] [--links 1] [--out DIR]

Every fold of runs is predicted by a robot fitted to the others, from nominal values, and by the baseline fitted to the same;
all know what was measured before the start of a prediction. Intervals: 95 %, bootstrap over runs. DIR keeps every fold's
result, so that a run that was stopped goes on with the next fold.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import align, moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.imu import imu_moved_back
from fish_sysid.dataset.read import read_experiment
from fish_sysid.diagnosis.vocabulary import choosable
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE, Parametrization
from fish_sysid.estimation.shooting.prediction_fit import LINKS, PredictionFit, fit_predictions
from fish_sysid.estimation.shooting.selection import INTRINSIC
from fish_sysid.prediction.baselines import fit_baselines, predict_baseline
from fish_sysid.prediction.kept_noise import with_noise
from fish_sysid.prediction.prediction import EVERY, HORIZONS, WARM_UP, predict, prediction_errors
from fish_sysid.prediction.stroke_average import HALF_WINDOW

QUANTITIES = ("position", "heading", "speed")
BOOTSTRAPS = 2000


def main() -> None:
    """Print a line per fold and the table; write everything as JSON if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--leave-out", type=int, default=1, help="runs per fold")
    parser.add_argument("--effects", default="", help="NAME,NAME or choose (anew in every fold)")
    parser.add_argument("--links", default=",".join(map(str, LINKS)), help="candidates")
    parser.add_argument("--only", default="", help="numbers of folds, from 0 (default: all)")
    parser.add_argument("--out", type=Path, help="folder for the folds' results")
    args = parser.parse_args()
    experiment, _ = read_experiment(args.dataset)
    count, folds = len(experiment.names), -(-len(experiment.names) // args.leave_out)
    squares = np.zeros((2, count, len(HORIZONS), 3))
    numbers = np.zeros((2, count, len(HORIZONS)))
    for fold in [int(n) for n in args.only.split(",") if n] or range(folds):
        left_out = [m for m in range(count) if m % folds == fold]
        kept = args.out / f"fold_{fold}.json" if args.out else None
        if kept and kept.exists():
            content = json.loads(kept.read_text())
        else:
            content = one_fold(experiment, left_out, args.effects, args.links)
            if kept:
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(content))
        squares[:, left_out], numbers[:, left_out] = content["squares"], content["numbers"]
        names = ", ".join(experiment.names[m] for m in left_out)
        print(f"without {names}: {content['seconds']:.0f} s of CPU", flush=True)
        print(json.dumps(content["fit"]), flush=True)
        report(squares, numbers)


def one_fold(
    experiment: Experiment, left_out: list[int], effects: str, links: str
) -> dict[str, object]:
    """Errors on the runs left out of the delay, the fit and the baseline, the fit, and processor seconds."""
    began, chosen = time.process_time(), effects == "choose"
    rest = [m for m in range(len(experiment.names)) if m not in left_out]
    given = tuple(n for n in effects.split(",") if n and not chosen)
    candidates = choosable() if chosen else ()
    lag = align(experiment.select(rest)).delay
    training = moved_back(experiment, lag).select(rest)
    counts = tuple(map(int, links.split(",")))
    fit = fit_predictions(
        training, Robot(), NOMINAL_FREE, given, candidates, print, counts, together=INTRINSIC
    )
    squares, numbers = judged(experiment, rest, left_out, lag, fit)
    return {
        "squares": squares.tolist(),
        "numbers": numbers.tolist(),
        "fit": described(fit),
        "z": fit.found.z.tolist(),
        "lag": lag,
        "seconds": time.process_time() - began,
    }


def described(fit: PredictionFit) -> dict[str, object]:
    """A fit as plain data."""
    names = fit.found.hypothesis.names
    values = Parametrization(fit.found.hypothesis).decode(fit.theta)
    parameters = dict(zip(fit.found.hypothesis.free, values.tolist(), strict=True))
    return {
        "links": fit.robot.links,
        "effects": names,
        "cost": fit.found.cost,
        "trust": asdict(fit.found.trust),
        "judged": [(s.name, s.gain, s.deviation, s.added) for s in (*fit.steps, *fit.links_judged)],
        **fit.sensors,
        "parameters": parameters,
    }


def judged(
    experiment: Experiment, rest: list[int], left_out: list[int], lag: float, fit: PredictionFit
) -> tuple[np.ndarray, np.ndarray]:
    """Squares (2, M, H, 3) and numbers (2, M, H) of predictions: physics, bilinear."""
    camera = max(lag + fit.sensors["camera_latency.delay"], 0.0)
    moved = imu_moved_back(
        moved_back(experiment, camera), max(fit.sensors["imu_latency.delay"], 0.0)
    )
    hypothesis, theta, _ = fit.with_camera()
    noise = usual_noise(moved.select(rest))
    robot = with_noise(
        Parametrization(hypothesis).robot(theta).without_effect("disturbance"),
        noise,
        "shooting",
        fit.found.trust,
    )
    made = predict(moved.select(left_out), robot, noise, max(HORIZONS), EVERY, WARM_UP)
    bilinear = fit_baselines(moved.select(rest))["bilinear"]
    pair = [prediction_errors(p) for p in (made, predict_baseline(bilinear, made, HALF_WINDOW))]
    return np.array([p.squares for p in pair]), np.array([p.counts for p in pair])


def report(squares: np.ndarray, numbers: np.ndarray) -> None:
    """Errors, ratios to the baseline and their intervals over the runs judged so far."""
    random, done = np.random.default_rng(0), np.flatnonzero(numbers[0].any(axis=1))

    def ratios(runs: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            rms = np.sqrt(squares[:, runs].sum(1) / numbers[:, runs].sum(1)[..., None])
        return np.asarray(rms[0] / rms[1])

    drawn = [ratios(random.choice(done, len(done))) for _ in range(BOOTSTRAPS)]
    low, high = np.nanpercentile(drawn, [2.5, 97.5], axis=0)
    rms, ratio = np.sqrt(squares[0].sum(0) / numbers[0].sum(0)[:, None]), ratios(done)
    for i, h in enumerate(HORIZONS):
        cells = [
            f"{name} {rms[i, j]:.4f} ratio {ratio[i, j]:.2f} ({low[i, j]:.2f} to {high[i, j]:.2f})"
            for j, name in enumerate(QUANTITIES)
        ]
        print(f"{h:g} s: {'; '.join(cells)}; {numbers[0, :, i].sum():.0f} predictions", flush=True)


if __name__ == "__main__":
    main()
