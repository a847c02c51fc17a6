# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of designs: a calibration's swims and errors, and which names can be told apart."""

from __future__ import annotations

from typing import Any

import numpy as np

from fish_report.page import Table
from fish_sysid.design.calibration_plan import Plan
from fish_sysid.design.detectability import Detectability

MOST_LIKE = 2  # names shown beside one
LEAST_LIKE = 0.1  # share of the gain
FAINT = 10.0  # times the typical strength: an effect that is seen only from there on is not seen


def swim_table(plan: Plan) -> Table:
    """What is swum, and where the fish is put."""
    rows = [
        [f"{k}", f"{swim.length:g}", f"{x:+.2f}", f"{y:+.2f}", f"{heading:+.2f}", swim.what]
        for k, (swim, (x, y, heading)) in enumerate(
            zip(plan.swims, plan.start.tolist(), strict=True)
        )
    ]
    shortest = (
        f"No set of these swims is shorter than {plan.bound:.0f} s, parts of swims counted."
        if plan.bound
        else "How much shorter a set could be was not found."
    )
    return Table(
        f"{len(plan.swims)} swims, {plan.seconds:.0f} s with their glides",
        ["swim", "s", "x, m", "y, m", "heading, rad", "what"],
        rows,
        shortest,
    )


def error_table(plan: Plan) -> Table:
    """Standard errors that identification will state."""
    rows = [
        [name, f"{100.0 * wanted:.2g} %", f"{100.0 * expected:.2g} %"]
        for name, wanted, expected in zip(plan.names, plan.wanted, plan.expected, strict=True)
    ]
    return Table("Standard errors, of the worst robot", ["parameter", "wanted", "expected"], rows)


def distinguish_table(found: Detectability) -> Table:
    """A row for each name, the best seen first."""
    rows = []
    for i in np.argsort(found.strength, kind="stable"):
        like = [
            f"{found.names[j]} {100.0 * found.alike[i, j]:.0f} %"
            for j in np.argsort(-found.alike[i], kind="stable")
            if j != i and found.alike[i, j] >= LEAST_LIKE
        ][:MOST_LIKE]
        rivals = [
            name for j, name in enumerate(found.names) if j != i and found.telling[i, j] > 1.0
        ]
        seen = found.strength[i] <= FAINT
        rows.append(
            [
                found.names[i],
                f"{100.0 * found.strength[i]:.2g} %" if seen else "not seen",
                f"{100.0 * found.absorbed[i]:.0f} %",
                ", ".join(like) or "-",
                (", ".join(rivals) or "-") if seen else "all",
            ]
        )
    return Table(
        "Seen from which share of the typical strength on, and what looks like it",
        [
            "name",
            "seen from",
            "taken by parameters",
            "share of its gain that others take",
            "rivals at typical strength",
        ],
        rows,
        "Rivals: with the typical strength of the one, the probability of the other stays above 2 %.",
    )


def as_record(found: Detectability) -> dict[str, Any]:
    """All numbers, by name."""
    return {
        name: {
            "seen_from": found.strength[i],
            "taken_by_parameters": found.absorbed[i],
            "gain": found.gain[i],
            "needed": found.needed[i],
            "alike": dict(zip(found.names, found.alike[i].tolist(), strict=True)),
            "told_from": dict(zip(found.names, found.telling[i].tolist(), strict=True)),
        }
        for i, name in enumerate(found.names)
    }
