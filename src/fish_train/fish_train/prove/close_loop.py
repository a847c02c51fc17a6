"""Does a better model make better gains? Gains trained on four models, judged on the second plant.

nominal     the robot file as it is
refitted    `identify` on recordings of the plant
corrected   `diagnose` on the same recordings
true        gains searched on the plant itself, which no model can beat by much
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fish_control.contract import OUTPUTS
from fish_control.control_law import Gains
from fish_control.hand_tuned import HAND_TUNED
from fish_control.policy import Policy
from fish_sim.robot import Robot
from fish_train.errors import UserError
from fish_train.evaluation.candidates import read_policy
from fish_train.evaluation.cells import Cell, make_cells
from fish_train.evaluation.gains_source import PolicyGains
from fish_train.evaluation.plant import Plant
from fish_train.evaluation.study import Candidate, Condition, Row, run_study
from fish_train.json_file import write_json
from fish_train.prove.mujoco_effects import CONCEALED
from fish_train.prove.mujoco_plant import MujocoPlant
from fish_train.prove.study import read_json
from fish_train.prove.world import World
from fish_train.reports.page import Table

Array = NDArray[np.float64]

PATHS, SPEEDS = ("circle:radius=0.6", "figure_eight:length=2.6,width=1.1", "S"), (0.1, 0.15)  # speeds in m/s
SEARCHED = ("steering_kp", "steering_ki", "steering_kd", "speed_kp", "speed_ki")
SCALE = {"cross_track_rmse": 0.03, "speed_rmse": 0.03}  # m, m/s: errors of one in the search's cost
TITLES = {"cross_track_rmse": "cross-track RMSE, mm", "speed_rmse": "speed RMSE, mm/s"}
WIDE = 1.0  # of the logarithm of a gain, first step of the search
LINKS = 5
LOST = 10.0  # cost of a run without a result

Say = Callable[[str], None]


def loop_world(concealed: str, seed: int, trials: int, duration: float) -> World:
    """A world of the second plant with its own parameters as they are; "nothing" conceals nothing. Raises ValueError."""
    known = {"nothing": {}, **{name: dict(c.typical) for name, c in CONCEALED.items()}}
    if concealed not in known:
        raise ValueError(f"concealed: got {concealed!r}; expected one of {', '.join(known)}")
    effects = {concealed: known[concealed]} if known[concealed] else {}
    return World("mujoco", seed, effects, count=trials, duration=duration, plant="mujoco", links=LINKS)


@dataclass(frozen=True)
class SecondPlant:
    """`MakePlant` of the evaluation: the world's MuJoCo fish, whatever robot the evaluation believes in."""

    world: World

    def __call__(self, robots: Sequence[Robot], seeds: Sequence[int], disturbance: float = 0.0) -> Plant:  # noqa: ARG002
        """One fish for each robot; `disturbance` is the world's own."""
        return Swimmer(MujocoPlant.of(self.world, len(robots), np.random.default_rng([*seeds, 5])))


class Swimmer:
    """The evaluation's view of a plant: nobody asks what an IMU felt."""

    def __init__(self, plant: MujocoPlant) -> None:
        self._plant, self.reset = plant, plant.reset

    def step(self, commands: Array) -> None:
        """One period."""
        self._plant.step(commands)

    @property
    def motion(self) -> Array:
        """(M, 6)."""
        return self._plant.motion


@dataclass(frozen=True)
class Plan:
    """What is compared, and on what."""

    world: World
    recordings: Path  # of the plant
    out: Path
    nominal: Path | None = None  # robot.yaml; None: the nominal fish
    paths: Sequence[str] = PATHS
    speeds: Sequence[float] = SPEEDS
    seeds: int = 1
    search: int = 40  # runs of the search on the plant
    training: Sequence[str] = field(default_factory=tuple)  # more arguments of `train`


def close_loop(plan: Plan, jobs: int, say: Say) -> list[Row]:
    """Diagnose, identify, train, search, swim; what is there already is used."""
    robots = {"nominal": plan.nominal, **_models(plan, say)}
    candidates = []
    for name, robot in robots.items():
        say(f"training on the {name} model")
        candidates.append(read_policy(name, _train(plan, name, robot)))
    condition = Condition(name="second plant", plant=SecondPlant(plan.world))
    cells = make_cells(plan.paths, plan.speeds, range(1, plan.seeds + 1))
    say("searching gains on the plant itself")
    best = search(condition, cells, plan.search, jobs, plan.out / "search" / "tries.json", say)
    candidates.append(Candidate("true", PolicyGains(Policy.constant(best))))
    say("swimming")
    return run_study(candidates, [condition], cells, jobs)


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


def _train(plan: Plan, name: str, robot: Path | None) -> Path:
    weights = plan.out / "training" / name / "seed_1" / "gains.safetensors"
    if not weights.exists():
        given = ["--robot", str(robot)] if robot else []
        out = str(plan.out / "training" / name)
        try:
            _verb("train", "--out", out, "--jobs", "1", "--overwrite", *given, *plan.training)
        except UserError:
            if (
                not weights.exists()
            ):  # a recipe that this robot cannot swim to its end leaves gains all the same
                raise
    return weights


def _verb(*arguments: str) -> None:
    """Run a verb as a process of its own."""
    command = [sys.executable, "-m", "fish_train.commands.main", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stderr.strip() or done.stdout.strip())[-500:]
        raise UserError(f"fish_train {arguments[0]} ended with {done.returncode}: {said}")


def search(
    condition: Condition, cells: Sequence[Cell], runs: int, jobs: int, file: Path, say: Say = lambda _: None
) -> Gains:
    """Constant gains by a simplex search on the plant, perfect state, from the hand-tuned ones.

    What was tried before is in `file`: the same search goes on where it was stopped.
    """
    seen = replace(condition, fused=False)
    tried = {tuple(t["x"]): float(t["cost"]) for t in (read_json(file) if file.exists() else [])}
    file.parent.mkdir(parents=True, exist_ok=True)

    def gains(x: Array) -> Gains:
        wanted = HAND_TUNED._asdict()
        wanted |= {k: wanted[k] * float(np.exp(v)) for k, v in zip(SEARCHED, x, strict=True)}
        return Gains(*(float(np.clip(wanted[o.name], o.low, o.high)) for o in OUTPUTS))

    def cost(x: Array) -> float:
        key = tuple(x.tolist())
        if key not in tried:
            candidate = Candidate("", PolicyGains(Policy.constant(gains(x))))
            tried[key] = float(np.mean([_cost(row) for row in run_study([candidate], [seen], cells, jobs)]))
            write_json(file, [{"x": k, "cost": v} for k, v in tried.items()])
            say(f"gains {len(tried)} of {runs}: cost {tried[key]:.2f}, best {min(tried.values()):.2f}")
        return tried[key]

    start = np.vstack([np.zeros(len(SEARCHED)), WIDE * np.eye(len(SEARCHED))])
    found = minimize(cost, start[0], method="Nelder-Mead", options={"maxfev": runs, "initial_simplex": start})
    return gains(found.x)


def _cost(row: Row) -> float:
    sizes = row.metrics.whole
    value = sum(getattr(sizes, k) / unit for k, unit in SCALE.items())
    return value if np.isfinite(value) else LOST


def loop_table(rows: Sequence[Row]) -> Table:
    """Errors per model, and how much of the way from nominal to true each goes."""
    names = list(dict.fromkeys(row.candidate for row in rows))
    mean = {n: _mean([r for r in rows if r.candidate == n]) for n in names}
    header = ["gains from", *(text for k in SCALE for text in (TITLES[k], "of the gap")), "failed runs"]
    text = []
    for n in names:
        own = [r for r in rows if r.candidate == n]
        cells = [n]
        for best, first, size in zip(mean["true"], mean["nominal"], mean[n], strict=True):
            gap = f"{(first - size) / (first - best):.0%}" if first > best else "no gap"
            cells += [f"{1e3 * size:.1f}", gap]
        text.append([*cells, f"{sum(bool(r.metrics.failure) for r in own)} of {len(own)}"])
    note = "On the second plant, approach included. Gap: from the nominal model's gains to those searched on the plant."
    return Table("Gains from a corrected model", header, text, note)


def _mean(rows: Sequence[Row]) -> Array:
    """Errors in the order of SCALE, averaged over runs."""
    sizes: Array = np.array([[getattr(row.metrics.whole, key) for key in SCALE] for row in rows]).mean(axis=0)
    return sizes
