# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains searched on a plant itself: what no model can beat by much."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fish_control.control_law import Gains
from fish_control.hand_tuned import HAND_TUNED
from fish_control.policy import Policy
from fish_control.policy_spec import OUTPUTS
from fish_report.json_file import write_json
from fish_study.study import read_json
from fish_train.evaluation.candidates import Candidate, PolicyGains
from fish_train.evaluation.cells import Cell
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
