# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A plan of calibration: the shortest set of swims that determines a model's parameters to wanted errors, for `robofish excite`.

    min over counts n   sum of n_i t_i    so that   [(P^-2 + sum of n_i N_ir)^-1]_kk <= s_k^2   for all parameters k, robots r

N_ir: information of swim i on robot r, P: prior deviations, s: wanted errors (an optimal design with bounds on variances;
Pukelsheim 2006, ch. 9). Swims are added greedily, the one that brings errors down most for its time, then every swim is left out,
or put in the place of a longer one, while the bounds hold. With n real the problem is convex: its optimum is a bound that no set
can be shorter than.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fish_control.excitation import Program, Row
from fish_report.errors import UserError
from fish_report.files import write_json
from fish_sim.robot import Robot
from fish_sysid.design.candidate_swims import Candidate, candidates, placed, swim_seconds
from fish_sysid.design.sensitivity import SensorSet, information
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE, nominal_hypothesis

Array = NDArray[np.float64]
Report = Callable[[str], None]
Counts = NDArray[np.int64]

ERROR = 0.05  # wanted standard error of a parameter, as a share of it
ROBOTS = 3  # the given robot and others within its priors: the plan must do for all of them
SPREAD = 0.3  # of the others' parameters, at most: tens of per cent
MOST_REPEATS = 3  # of the same swim
MOST_SWIMS = 40


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
    hypothesis = nominal_hypothesis(robot, free)
    names = hypothesis.free
    wanted = np.array([(errors or {}).get(name, error) for name in names])
    if unknown := sorted(set(errors or {}) - set(names)):
        raise UserError(f"error of {unknown[0]}: expected one of {', '.join(names)}")
    if (odd := ~((wanted > 0.0) & (wanted < np.inf))).any():
        raise UserError(
            f"error of {names[int(odd.argmax())]}: got {wanted[odd][0]:g}; expected a share above 0, as 0.05 for 5 %"
        )
    report("swims that the pool has room for")
    swims, commands = placed(candidates() if choose_from is None else choose_from, robot)
    seconds, tables = swim_seconds(commands), []
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


def standard_errors(information: Array, counts: Array | Counts, prior: Array) -> Array:
    """(R, K) of information (R, M, K, K) of each swim on each robot, and of a prior (K,)."""
    total = np.tensordot(counts, information, axes=(0, 1)) + np.diag(1.0 / prior**2)
    return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(total), axis1=1, axis2=2)))


def reachable(information: Array, prior: Array) -> Array:
    """(K,) errors of the worst robot with every swim swum MOST_REPEATS times: no plan reaches less."""
    everything = np.full(information.shape[1], float(MOST_REPEATS))
    return np.asarray(standard_errors(information, everything, prior).max(axis=0))


def shortest_set(information: Array, seconds: Array, prior: Array, wanted: Array) -> Counts:
    """How often each swim is swum (M,), for errors wanted (K,) that are reachable.

    Raises ValueError where MOST_SWIMS do not suffice.
    """
    counts: Counts = np.zeros(information.shape[1], dtype=np.int64)
    while (before := _excess(information, counts, prior, wanted)) > 0.0:
        if counts.sum() == MOST_SWIMS:
            raise ValueError(f"{MOST_SWIMS} swims do not suffice: expected larger errors")
        possible = np.flatnonzero(counts < MOST_REPEATS)
        falls = [
            (before - _excess(information, _with(counts, int(i), 1), prior, wanted)) / seconds[i]
            for i in possible
        ]
        counts = _with(counts, int(possible[np.argmax(falls)]), 1)
    return _shortened(information, seconds, prior, wanted, counts)


def shortest_possible(information: Array, seconds: Array, prior: Array, wanted: Array) -> float:
    """Seconds that no set of these swims can do with less of, parts of swims included."""
    R, M, K, _ = information.shape
    start = np.full(M, float(MOST_REPEATS))

    def inverse(n: Array) -> Array:
        return np.asarray(
            np.linalg.inv(np.tensordot(n, information, axes=(0, 1)) + np.diag(1.0 / prior**2))
        )

    def slack(n: Array) -> Array:
        return (1.0 - np.diagonal(inverse(n), axis1=1, axis2=2) / wanted**2).ravel()

    def slopes(n: Array) -> Array:
        V = inverse(n)
        turned = np.einsum("rka,rmab,rkb->rkm", V, information, V, optimize=True)
        return np.asarray((turned / wanted[:, None] ** 2).reshape(R * K, M))

    found = minimize(
        lambda n: float(seconds @ n) / seconds.sum(),
        start,
        jac=lambda _: seconds / seconds.sum(),
        method="SLSQP",
        bounds=[(0.0, float(MOST_REPEATS))] * M,
        constraints={"type": "ineq", "fun": slack, "jac": slopes},
        options={"maxiter": 200, "ftol": 1e-7},
    )
    return float(seconds @ found.x) if found.success else 0.0


def _excess(information: Array, counts: Counts, prior: Array, wanted: Array) -> float:
    """Sum over parameters of the logarithms by which the worst robot's errors are too large; 0: all bounds hold."""
    worst = standard_errors(information, counts, prior).max(axis=0)
    return float(np.maximum(np.log(worst / wanted), 0.0).sum())


def _with(counts: Counts, i: int, more: int) -> Counts:
    out = counts.copy()
    out[i] += more
    return out


def _shortened(
    information: Array, seconds: Array, prior: Array, wanted: Array, counts: Counts
) -> Counts:
    """Swims left out, or changed for shorter ones, as long as the bounds hold."""
    changed = True
    while changed:
        changed = False
        for i in sorted(np.flatnonzero(counts), key=lambda i: -seconds[i]):
            without = _with(counts, int(i), -1)
            shorter = [
                None,
                *np.argsort(seconds, kind="stable")[: int((seconds < seconds[i]).sum())],
            ]
            for other in shorter:
                tried = without if other is None else _with(without, int(other), 1)
                if tried.max() > MOST_REPEATS:
                    continue
                if _excess(information, tried, prior, wanted) == 0.0:
                    counts, changed = tried, True
                    break
            if changed:
                break
    return counts
