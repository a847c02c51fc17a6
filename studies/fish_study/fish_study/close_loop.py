# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Does a better model make better gains? Gains trained on three models and searched on the second plant, compared there.

nominal     the robot file as it is
refitted    `identify` on recordings of the plant
corrected   `diagnose` on the same recordings
true        gains searched on the plant itself (`plant_swims.search`)

Each with the feed-forward of what its gains were made on (`law_of_plant`), the plant's from swims in still water. All
trainings are alike (TRAINING), several of each model, as one says little: all of them are compared. The search has other
seeds (start and water) than the runs that are compared.

The folder of a closed loop says for which scenario it was made, so that nothing in it is taken for another scenario's:

loop.json    the scenario and the arguments on which what is kept depends
recordings   of the second plant, all trials or none
"""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_control.policy import Policy
from fish_report.errors import UserError
from fish_report.files import plain, write_json
from fish_report.parallel import on_threads
from fish_sim.robot import Robot
from fish_study.build import make_recordings
from fish_study.mujoco_effects import CONCEALED
from fish_study.mujoco_plant import MujocoError, MujocoPlant
from fish_study.plant_swims import Say, search, swim_each
from fish_study.scenario import Scenario
from fish_study.study import StudyError, read_json
from fish_train.evaluation.candidates import Candidate, PolicyGains, read_policy
from fish_train.evaluation.cells import make_cells
from fish_train.evaluation.open_loop import law_of_plant
from fish_train.evaluation.plant import Plant
from fish_train.evaluation.study import Condition, Row
from fish_train.training.closed_loop_equations import Law

Array = NDArray[np.float64]

PATHS, SPEEDS = (
    ("circle:radius=0.6", "figure_eight:length=2.6,width=1.1", "S"),
    (0.1, 0.15),
)  # speeds in m/s
# those between were seen when recipe and plant were chosen
SEARCH_SEEDS, EVALUATION_SEEDS = (1,), (22, 23, 24, 25)
LINKS = 5
# of every training: runs are compared through camera, IMU and fusion, on a robot that no model is exactly; with such noise a
# level of 0.01 m is not passed. What is compared is the path: a fish that holds its speed in a bend leaves it
TRAINING = (
    "--set",
    "randomise=0.2",
    "latency=0.1",
    "noise_position=0.003",
    "noise_heading=0.02",
    "noise_speed=0.01",
    "noise_rate=0.05",
    "thresholds=[0.03,0.02]",
    "cost_speed=5.0",
    "cost_setpoint_change=0.2",
)


def loop_scenario(concealed: str, seed: int, trials: int, duration: float) -> Scenario:
    """A scenario of the second plant with its own parameters as they are; "nothing" conceals nothing. Raises ValueError."""
    known = {"nothing": {}, **{name: dict(c.typical) for name, c in CONCEALED.items()}}
    if concealed not in known:
        raise ValueError(f"concealed: got {concealed!r}; expected one of {', '.join(known)}")
    effects = {concealed: known[concealed]} if known[concealed] else {}
    return Scenario(
        "mujoco", seed, effects, count=trials, duration=duration, plant="mujoco", links=LINKS
    )


@dataclass(frozen=True)
class SecondPlant:
    """`MakePlant` of the evaluation: the scenario's MuJoCo fish, whatever robot the evaluation believes in."""

    scenario: Scenario

    def __call__(
        self,
        robots: Sequence[Robot],
        seeds: Sequence[int],
        disturbance: float = 0.0,  # noqa: ARG002
    ) -> Plant:
        """One fish for each robot; `disturbance` is the scenario's own."""
        return Swimmer(
            MujocoPlant.of(self.scenario, len(robots), np.random.default_rng([*seeds, 5]))
        )


class Swimmer:
    """The evaluation's view of a plant: nobody asks what an IMU felt, and a fish that becomes unstable is a run that diverged."""

    def __init__(self, plant: MujocoPlant) -> None:
        self._plant, self.reset = plant, plant.reset

    def step(self, commands: Array) -> None:
        """One period."""
        with contextlib.suppress(
            MujocoError
        ):  # the motion says it: NaN of this fish, the others swim on
            self._plant.step(commands)

    @property
    def motion(self) -> Array:
        """(M, 6); NaN of fish that became unstable."""
        return self._plant.motion


@dataclass(frozen=True)
class Plan:
    """What is compared, and on what."""

    scenario: Scenario
    recordings: Path  # of the plant
    out: Path
    nominal: Path | None = None  # robot.yaml; None: the nominal fish
    paths: Sequence[str] = PATHS
    speeds: Sequence[float] = SPEEDS
    search: int = 40  # runs of the search on the plant
    training: Sequence[str] = TRAINING  # more arguments of `train`
    trainings: int = 3  # of each model, from seeds of their own


def close_loop(plan: Plan, jobs: int, say: Say) -> list[Row]:
    """Identify, diagnose, train (`jobs` side by side), search, swim; what is there already is used.

    Rows of all trainings of a model bear its name, one training after the other.
    """
    robots = {"nominal": plan.nominal, **_models(plan, say)}
    gains = _trained(plan, robots, jobs, say)
    condition = Condition(name="second plant", plant=SecondPlant(plan.scenario))
    say("searching gains on the plant itself")
    cells = make_cells(plan.paths, plan.speeds, SEARCH_SEEDS)
    law = _plant_law(plan.scenario)
    best = search(condition, cells, plan.search, jobs, plan.out / "search" / "tries.json", say, law)
    gains["true"] = Candidate("true", PolicyGains(Policy.constant(best)), law)
    compared = make_cells(plan.paths, plan.speeds, EVALUATION_SEEDS)
    return swim_each(gains, condition, compared, jobs, plan.out / "swims", say)


def _plant_law(scenario: Scenario) -> Law:
    """The law with the feed-forward of the plant, which is no matter of the wind."""
    still = replace(
        scenario, effects={name: v for name, v in scenario.effects.items() if name != "wind"}
    )
    return law_of_plant(
        lambda count: Swimmer(
            MujocoPlant.of(still, count, np.random.default_rng([scenario.seed, 6]))
        )
    )


def _models(plan: Plan, say: Say) -> dict[str, Path]:
    """Files of the refitted and of the corrected robot."""
    made = {"refitted": ("identify", "robot.yaml"), "corrected": ("diagnose", "model.yaml")}
    files = {}
    for name, (verb, file) in made.items():
        folder = plan.out / verb
        if not (folder / file).exists():
            say(f"{verb}: {plan.recordings}")
            robot = ["--robot", str(plan.nominal)] if plan.nominal else []
            _verb(verb, str(plan.recordings), "--out", str(folder), *robot)
        files[name] = folder / file
    return files


def _trained(
    plan: Plan, robots: Mapping[str, Path | None], jobs: int, say: Say
) -> dict[str, Candidate]:
    """The gains of all trainings on each model, MODEL_SEED, `jobs` of them side by side."""
    say(f"training on the models {', '.join(robots)}, {plan.trainings} times on each")
    runs = list(product(range(1, plan.trainings + 1), robots))
    gains = {}
    weights = on_threads(lambda run: _train(plan, run[1], robots[run[1]], run[0]), runs, jobs)
    for (seed, name), file in zip(runs, weights, strict=True):
        gains[f"{name}_{seed}"] = read_policy(name, file)
        say(f"trained: {len(gains)} of {len(runs)}")
    return gains


def _train(plan: Plan, name: str, robot: Path | None, seed: int) -> Path:
    """Weights of one training on one model; one that was stopped goes on from its checkpoint."""
    out = plan.out / "training" / name
    weights = out / f"seed_{seed}" / "gains.safetensors"
    if not weights.exists():
        given = ["--robot", str(robot)] if robot else []
        try:
            _verb(
                "train", "--out", str(out), "--seed", str(seed), "--resume", *given, *plan.training
            )
        except UserError:
            # a recipe that this robot cannot swim to its end leaves gains all the same
            if not weights.exists():
                raise
    return weights


def _verb(*arguments: str) -> None:
    """Run a verb as a process of its own."""
    command = [sys.executable, "-m", "fish_report.robofish", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stderr.strip() or done.stdout.strip())[-500:]
        raise UserError(f"robofish {arguments[0]} ended with {done.returncode}: {said}")


def prepare(plan: Plan) -> None:
    """Make a new folder with the recordings, or go on in the same plan's. Raises StudyError where it is none of this plan."""
    _claim(plan)
    if plan.recordings.exists():
        return
    part = plan.recordings.with_suffix(".part")  # half a set must not pass for a whole one
    shutil.rmtree(part, ignore_errors=True)
    make_recordings(plan.scenario, part)
    part.rename(plan.recordings)


def _claim(plan: Plan) -> None:
    path, asked = plan.out / "loop.json", _asked(plan)
    if not path.exists():
        if plan.out.exists() and any(plan.out.iterdir()):
            raise StudyError(
                f"{plan.out}: has no loop.json, so nothing says for which scenario its files were made; expected a new or empty"
                " folder: choose another --out, or move these files away"
            )
        plan.out.mkdir(parents=True, exist_ok=True)
        write_json(path, asked)
    made = read_json(path)
    differ = [key for key in {**made, **asked} if made.get(key) != asked.get(key)]
    if differ:
        said = "; ".join(f"{key} {made.get(key)}, got {asked.get(key)}" for key in differ)
        raise StudyError(
            f"{plan.out}: holds a loop of {said}: ask for the same, or choose another --out"
        )


def _asked(plan: Plan) -> dict[str, Any]:
    """As JSON gives it back. What is made anew at every run, the number of trainings and of tries in the search are no part."""
    return dict(
        plain(
            {
                **plan.scenario.label(),
                "robot": None if plan.nominal is None else str(plan.nominal.resolve()),
                "paths": plan.paths,
                "speeds": plan.speeds,
                "search seeds": SEARCH_SEEDS,
                "training": plan.training,
            }
        )
    )
