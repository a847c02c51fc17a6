# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swims of gains on a plant itself: the search of the best ones, which no model can beat by much, and swims that are kept.

A file for each gains: a closed loop that was stopped swims none of them twice.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fish_control.control_law import Gains
from fish_control.hand_tuned import HAND_TUNED
from fish_control.policy import Policy
from fish_control.policy_spec import OUTPUTS
from fish_report.files import number, write_json
from fish_study.study import read_json
from fish_train.evaluation.candidates import Candidate, PolicyGains
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.study import Condition, Row, run_study
from fish_train.training.closed_loop_equations import Law

Array = NDArray[np.float64]

SEARCHED = ("steering_kp", "steering_ki", "steering_kd", "speed_kp", "speed_ki")
SCALE = {"cross_track_rmse": 0.03, "speed_rmse": 0.03}  # m, m/s: errors of one in the search's cost
WIDE = 1.0  # of the logarithm of a gain, first step of the search
LOST = 10.0  # cost of a run without a result

Say = Callable[[str], None]


def search(
    condition: Condition,
    cells: Sequence[Cell],
    runs: int,
    jobs: int,
    file: Path,
    say: Say = lambda _: None,
    law: Law | None = None,
) -> Gains:
    """Constant gains of a law (default: the nominal fish's) by a simplex search on the plant, perfect state, from the hand's.

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
            candidate = Candidate("", PolicyGains(Policy.constant(gains(x))), law or Law())
            tried[key] = float(
                np.mean([_cost(row) for row in run_study([candidate], [seen], cells, jobs)])
            )
            write_json(file, [{"x": k, "cost": v} for k, v in tried.items()])
            say(
                f"gains {len(tried)} of {runs}: cost {tried[key]:.2f}, best {min(tried.values()):.2f}"
            )
        return tried[key]

    start = np.vstack([np.zeros(len(SEARCHED)), WIDE * np.eye(len(SEARCHED))])
    found = minimize(
        cost, start[0], method="Nelder-Mead", options={"maxfev": runs, "initial_simplex": start}
    )
    return gains(found.x)


def _cost(row: Row) -> float:
    sizes = row.metrics.whole
    value = sum(getattr(sizes, k) / unit for k, unit in SCALE.items())
    return value if np.isfinite(value) else LOST


def swim_each(
    gains: Mapping[str, Candidate],
    condition: Condition,
    cells: Sequence[Cell],
    jobs: int,
    folder: Path,
    say: Say,
) -> list[Row]:
    """Rows of all cells for each gains, in order; `folder` has NAME.json of those that are swum."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {
        name: _kept(folder / f"{name}.json", candidate, cells) for name, candidate in gains.items()
    }

    def keep(_: int, batch: list[Row]) -> None:
        name = batch[0].candidate
        rows[name] += batch
        if len(rows[name]) == len(cells):
            _keep(folder / f"{name}.json", gains[name], cells, rows[name])

    left = [replace(candidate, name=name) for name, candidate in gains.items() if not rows[name]]
    if left:
        say(f"swimming: {len(cells)} runs with each of {len(left)} gains")
        run_study(
            left,
            [condition],
            cells,
            jobs,
            lambda done, all_: say(f"swum: {done} of {all_} batches"),
            keep,
        )
    return [
        replace(row, candidate=candidate.name)
        for name, candidate in gains.items()
        for row in sorted(rows[name], key=lambda row: cells.index(row.cell))
    ]


def _keep(file: Path, candidate: Candidate, cells: Sequence[Cell], rows: Sequence[Row]) -> None:
    write_json(file, {"of": _what(candidate, cells), "rows": [asdict(row) for row in rows]})


def _kept(file: Path, candidate: Candidate, cells: Sequence[Cell]) -> list[Row]:
    """Empty where nothing was swum, or with other gains, another law or other cells."""
    content = read_json(file) if file.exists() else {}
    return (
        [_row(row) for row in content["rows"]]
        if content.get("of") == _what(candidate, cells)
        else []
    )


def _row(content: Mapping[str, Any]) -> Row:
    metrics = content["metrics"]
    settled, whole = (
        ErrorSizes(**{key: number(value) for key, value in metrics[part].items()})
        for part in ("settled", "whole")
    )
    measured = RunMetrics(settled, whole, number(metrics["approach"]), metrics["failure"])
    return Row(content["candidate"], content["condition"], Cell(**content["cell"]), measured)


def _what(candidate: Candidate, cells: Sequence[Cell]) -> str:
    """SHA-256 of weights, law and cells."""
    assert isinstance(candidate.gains, PolicyGains)
    policy = candidate.gains.policy
    digest = hashlib.sha256(json.dumps(policy.contract.to_json(), sort_keys=True).encode())
    for name, tensor in sorted(policy.tensors.items()):
        digest.update(name.encode() + tensor.tobytes())
    digest.update(f"{candidate.law} {list(cells)}".encode())
    return digest.hexdigest()
