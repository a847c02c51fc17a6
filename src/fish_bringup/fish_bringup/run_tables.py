# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables of a run beside those of its errors: latency and processor time."""

from __future__ import annotations

from fish_bringup.node_table import NAMESPACE, NodeSpec
from fish_bringup.run_watch import SwimEnd
from fish_report.page import Table
from fish_report.printable import plain


def latency_table(diagnostics: dict[str, dict[str, str]]) -> Table:
    """What the controller says of its own latency and period."""
    said = diagnostics.get(f"{NAMESPACE.strip('/')}/controller", {})
    rows = [
        [plain(key), plain(value)]
        for key, value in said.items()
        if "latency" in key or "period" in key
    ]
    return Table(
        "Controller",
        ["value", "measured"],
        rows,
        "Latency: stamp of the measurement to the command.",
    )


def cpu_table(end: SwimEnd) -> Table:
    """What each process used."""
    rows = [[_nodes(spec), f"{100 * share:.0f} %"] for spec, share in end.cpu.items()]
    rows.append(["all nodes", f"{100 * sum(end.cpu.values()):.0f} %"])
    return Table(
        "CPU",
        ["node", "of one core"],
        rows,
        f"Processor time for the robot's own time, over {end.robot_s:.0f} s of swimming, which took {end.seconds:.0f} s.",
    )


def _nodes(spec: NodeSpec) -> str:
    """The nodes of a process."""
    return f"{spec.package}/{' + '.join(part.executable for part in spec.parts or (spec,))}"
