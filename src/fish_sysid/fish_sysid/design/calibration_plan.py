# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A plan of calibration: swims that determine a model's parameters to wanted errors, for `robofish excite`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.excitation import Program, Row
from fish_report.errors import UserError
from fish_report.json_file import write_json
from fish_sim.robot import Robot
from fish_sysid.design.candidate_swims import Candidate, candidates, placed, swim_seconds
from fish_sysid.design.noise_free import SensorSet
from fish_sysid.design.sensitivity import information
from fish_sysid.design.shortest_set import (
    reachable,
    shortest_possible,
    shortest_set,
    standard_errors,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE, nominal_hypothesis

Array = NDArray[np.float64]
Report = Callable[[str], None]

ERROR = 0.05  # wanted standard error of a parameter, as a share of it
ROBOTS = 3  # the given robot and others within its priors: the plan must do for all of them
SPREAD = 0.3  # of the others' parameters, at most: tens of per cent


@dataclass(frozen=True)
class Plan:
    """Swims, and the standard errors that `identify` will state of them, as shares of the parameters."""

    swims: tuple[Candidate, ...]
    start: Array  # (S, 3) where the fish is put at rest, x, y [m], heading [rad]
    seconds: float  # with the glides
    bound: float  # s, which no set of these candidates can do with less of; 0: not found
    names: tuple[str, ...]
    wanted: Array  # (K,)
    expected: Array  # (K,) of the worst robot

    @property
    def program(self) -> Program:
        """All swims one after the other."""
        begins = np.concatenate([[0.0], np.cumsum([swim.length for swim in self.swims])])
        rows = [
            row._replace(t=round(float(begin) + row.t, 6))
            for begin, swim in zip(begins, self.swims, strict=False)
            for row in swim.rows
        ]
        return Program(tuple(rows), tuple(begins[1:].tolist()))


def plan_calibration(
    robot: Robot,
    sensors: SensorSet | None = None,
    noise: Noise | None = None,
    error: float = ERROR,
    errors: Mapping[str, float] | None = None,
    free: tuple[str, ...] = NOMINAL_FREE,
    robots: int = ROBOTS,
    choose_from: list[Candidate] | None = None,
    report: Report = lambda _: None,
) -> Plan:
    """The shortest plan for a robot like this one. error: wanted of all parameters, `errors` of single ones.

    Raises UserError where an error is no share, or no set of swims reaches what is wanted.
    """
    sensors, noise = sensors or SensorSet(), noise or Noise()
    report("swims that the pool has room for")
    swims, commands = placed(candidates() if choose_from is None else choose_from, robot)
    hypothesis = nominal_hypothesis(robot, free)
    names, seconds = hypothesis.free, swim_seconds(commands)
    wanted = np.array([(errors or {}).get(name, error) for name in names])
    if unknown := sorted(set(errors or {}) - set(names)):
        raise UserError(f"error of {unknown[0]}: expected one of {', '.join(names)}")
    if (odd := ~((wanted > 0.0) & (wanted < np.inf))).any():
        raise UserError(
            f"error of {names[int(odd.argmax())]}: got {wanted[odd][0]:g}; expected a share above 0, as 0.05 for 5 %"
        )
    tables = []
    for number, like in enumerate(robots_like(robot, free, robots)):
        report(f"information of {len(swims)} swims, robot {number + 1} of {robots}")
        tables.append(information(nominal_hypothesis(like, free), commands, sensors, noise))
    every, prior = np.array(tables), hypothesis.parametrization.prior
    least = reachable(every, prior)
    if (beyond := least > 0.99 * wanted).any():
        said = ", ".join(
            f"{n} {100 * e:.2g} %"
            for n, e in zip(np.array(names)[beyond], least[beyond], strict=True)
        )
        raise UserError(
            f"no set of swims reaches these errors; the least that all of them reach: {said}"
        )
    report("the shortest set")
    try:
        counts = shortest_set(every, seconds, prior, wanted)
    except ValueError as problem:
        raise UserError(str(problem)) from None
    report("a bound of its length")
    chosen = np.repeat(np.arange(len(swims)), counts)
    return Plan(
        tuple(swims[i] for i in chosen),
        commands.start[chosen],
        float(seconds @ counts),
        shortest_possible(every, seconds, prior, wanted),
        names,
        wanted,
        standard_errors(every, counts, prior).max(axis=0),
    )


def robots_like(robot: Robot, free: tuple[str, ...], count: int, seed: int = 0) -> list[Robot]:
    """The robot and others whose free parameters lie within its priors, and within SPREAD of its own."""
    random, out = np.random.default_rng(seed), [robot]
    hypothesis = nominal_hypothesis(robot, free)
    width = np.minimum(hypothesis.parametrization.prior, SPREAD)
    for _ in range(count - 1):
        theta = width * random.uniform(-1.0, 1.0, len(width))
        like = hypothesis.parametrization.robot(theta)
        out.append(robot.with_parameters(**like.parameters))
    return out


def write_plan(path: Path, plan: Plan) -> None:
    """Write the plan as JSON that `robofish excite` swims."""
    program, begin = plan.program, 0.0
    swims = []
    for swim, start, end in zip(plan.swims, plan.start.tolist(), program.ends, strict=True):
        place = dict(zip(("x", "y", "heading"), start, strict=True))
        swims.append({"what": swim.what, "begin": begin, "end": end, **place})
        begin = end
    write_json(
        path,
        {
            "program": [dict(zip(Row._fields, row, strict=True)) for row in program.rows],
            "swims": swims,
            "seconds": plan.seconds,
            "shortest_possible": plan.bound or None,
            "parameters": {
                name: {"wanted": w, "expected": e}
                for name, w, e in zip(plan.names, plan.wanted, plan.expected, strict=True)
            },
        },
    )
