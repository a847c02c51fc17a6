"""Compare the simulator with trajectories of an independent implementation of the same equations.

    python src/fish_sim/benchmarks/check_reference.py [FOLDER]

FOLDER (default ../shared/reference beside the checkout) holds CSV files: time, q, q', alpha, tip force,
inputs; they were integrated with RK4 at 0.5 ms. Prints, for every file, the largest difference of any
quantity relative to its largest value: with that same method (the equations alone), with two coarser steps,
and the reference's own integration error (RK4 at 0.5 ms against DOP853 at 0.5 ms), below which no better
integrator can agree with it.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path

import numpy as np

from fish_sim.model import DT, Layout
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper

DEFAULT = Path(__file__).resolve().parents[4] / "shared" / "reference"
LIMIT = 1e-4  # at 5 ms or finer, beside the reference's own error
SAME_METHOD_LIMIT = 1e-7  # the files have ten digits
REFERENCE_SCHEME = Scheme("rk4", 20)


def read(path: Path) -> tuple[str, dict[str, np.ndarray]]:
    """(comment line, columns by name)."""
    with path.open() as file:
        comment = file.readline()
        names, *rows = csv.reader(file)
    return comment, dict(zip(names, np.array(rows, float).T, strict=True))


def robot_of(comment: str) -> Robot:
    """The robot a file's comment describes."""
    robot = Robot(links=int(re.search(r"n=(\d)", comment)[1]))
    if "all drags zero" in comment:
        robot = robot.with_parameters(**{k: 0.0 for k in robot.parameters if "_drag_" in k})
    return robot


def simulate(comment: str, table: dict[str, np.ndarray], scheme: Scheme) -> np.ndarray:
    """q and q' under the file's inputs, one row for every row of the file."""
    robot = robot_of(comment)
    stepper = Stepper(robot.structure, scheme)
    start = stepper.rest(rudder=table["alpha"][0])
    start[: 2 * (robot.links + 3)] = motion(table, robot.links)[0]
    every = round((table["t"][1] - table["t"][0]) / DT)
    times = DT * np.arange(1, every * (len(table["t"]) - 1) + 1)
    rotor = np.interp(times, table["t"], table["rotor_speed"])
    rudder = np.repeat(table["rudder_command"], every)[: len(rotor)]
    states = stepper.rollout(start, np.stack([rotor, rudder], axis=-1), stepper.parameters(robot))
    return states[::every, : 2 * (robot.links + 3)]


def motion(table: dict[str, np.ndarray], links: int) -> np.ndarray:
    """q and q' of the file, (rows, 2 n + 6)."""
    names = Layout((links, ())).motion
    return np.stack([table[name] for name in names], axis=-1)


def compare(path: Path) -> bool:
    """Print one line; True if the file is reproduced."""
    comment, table = read(path)
    links = robot_of(comment).links
    reference = motion(table, links)
    steps = 1 if links <= 3 else 2  # in 10 ms; more for the faster tail

    def distance(a: np.ndarray, b: np.ndarray) -> float:
        return float((np.abs(a - b).max(0) / np.abs(reference).max(0).clip(1e-9)).max())

    schemes = (REFERENCE_SCHEME, *(Scheme("dop853", k) for k in (steps, 2 * steps, 20)))
    runs = [simulate(comment, table, scheme) for scheme in schemes]
    same, coarse, fine, _ = (distance(run, reference) for run in runs)
    own = distance(runs[0], runs[-1])
    print(
        f"{path.name:20} same method {same:.1e}   {10 / steps:g} ms {coarse:.1e}"
        f"   {5 / steps:g} ms {fine:.1e}   reference's own error {own:.1e}"
    )
    return same < SAME_METHOD_LIMIT and fine < LIMIT + own


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    files = sorted(folder.glob("*.csv"))
    if not files:
        print(
            f"check_reference: no reference trajectories in {folder}; nothing was compared", file=sys.stderr
        )
        return 2
    reproduced = [compare(path) for path in files]
    print("reproduced" if all(reproduced) else "NOT reproduced")
    return 0 if all(reproduced) else 1


if __name__ == "__main__":
    raise SystemExit(main())
