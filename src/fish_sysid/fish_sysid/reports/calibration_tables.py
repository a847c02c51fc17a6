# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of a calibration plan."""

from __future__ import annotations

from fish_report.page import Table
from fish_sysid.design.calibration_plan import Plan


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
