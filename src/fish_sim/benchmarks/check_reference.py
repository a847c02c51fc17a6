# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compare the simulator with trajectories of an independent implementation of the same equations.

    python src/fish_sim/benchmarks/check_reference.py FOLDER

FOLDER, which does not come with the project, holds CSV files: time, q, q', alpha, tip force, inputs; they were
integrated with RK4 at 0.5 ms. Prints for every file differences relative to the largest value of each quantity, the
worst of them:
  same method   our equations integrated as the file was (RK4 at 0.5 ms)
  ours          our default scheme, but steps of 5 ms at most
  halved        ours against ours with half the steps: our own integration error
  its own       the file's integration error: RK4 at 0.5 ms against CFMR7 at 0.5 ms, below which no better
                integrator can agree with it
and, of the files without drag and drive, by how much the energy changes in the worst second, ours and the file's.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from fish_sim.dynamics import energy
from fish_sim.model import DT, Layout
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme, default_scheme
from fish_sim.step import Stepper

LIMIT = 1e-4  # at 5 ms or finer, beside the reference's own error
ENERGY_LIMIT = 1e-6  # per second
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


def energy_change(comment: str, table: dict[str, np.ndarray], states: np.ndarray) -> float:
    """Largest change of the energy within a second, relative to the start."""
    robot = robot_of(comment)
    q, qd = np.split(states.T, 2)
    E = energy(q, qd, table["alpha"], SimpleNamespace(**robot.parameters), NUMPY)
    second = round(1.0 / (table["t"][1] - table["t"][0]))
    return float(np.abs(E[second:] - E[:-second]).max() / E[0])


def compare(path: Path) -> bool:
    """Print one line; True if the file is reproduced."""
    comment, table = read(path)
    links = robot_of(comment).links
    reference = motion(table, links)
    steps = max(2, default_scheme(links).substeps)

    def distance(a: np.ndarray, b: np.ndarray) -> float:
        return float((np.abs(a - b).max(0) / np.abs(reference).max(0).clip(1e-9)).max())

    schemes = (REFERENCE_SCHEME, *(Scheme(substeps=k) for k in (steps, 2 * steps, 20)))
    same, ours, halved, fine = (simulate(comment, table, scheme) for scheme in schemes)
    own = distance(same, fine)
    print(
        f"{path.name:20} same method {distance(same, reference):.1e}   ours ({10 / steps:.3g} ms)"
        f" {distance(ours, reference):.1e}   halved {distance(ours, halved):.1e}   its own {own:.1e}",
        flush=True,
    )
    good = distance(same, reference) < SAME_METHOD_LIMIT and distance(ours, halved) < LIMIT
    if "energy is constant" in comment:
        changes = [energy_change(comment, table, states) for states in (ours, reference)]
        print(
            f"{'':20} energy in the worst second: ours {changes[0]:.1e}, the file's {changes[1]:.1e}"
        )
        good = good and changes[0] < ENERGY_LIMIT
    return good and distance(ours, reference) < LIMIT + own


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: check_reference.py FOLDER (of reference trajectories, CSV)", file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    files = sorted(folder.glob("*.csv"))
    if not files:
        print(
            f"check_reference: no reference trajectories in {folder}; nothing was compared",
            file=sys.stderr,
        )
        return 2
    reproduced = [compare(path) for path in files]
    print("reproduced" if all(reproduced) else "NOT reproduced")
    return 0 if all(reproduced) else 1


if __name__ == "__main__":
    raise SystemExit(main())
