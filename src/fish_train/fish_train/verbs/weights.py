# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Show what is in a weights file: contract, layers, gains at a few situations.

robofish weights show FILE
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from fish_control.gains_file import GainsFileError, read_gains_file
from fish_control.policy import Policy, policy_inputs
from fish_control.policy_spec import INPUTS
from fish_report.errors import UserError
from fish_report.terminal import cell, terminal

SITUATIONS = (  # heading error [rad], speed error [m/s], cross-track error [m], wanted speed [m/s]
    ("on the path, 0.1 m/s", 0.0, 0.0, 0.0, 0.1),
    ("on the path, 0.2 m/s", 0.0, 0.0, 0.0, 0.2),
    ("on the path, 0.3 m/s", 0.0, 0.0, 0.0, 0.3),
    ("0.3 rad to the left wanted", 0.3, 0.0, 0.0, 0.2),
    ("5 cm left of the path", -0.12, 0.0, 0.05, 0.2),
    ("at rest, 0.2 m/s wanted", 0.0, 0.2, 0.0, 0.2),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument("what", choices=["show"], help="show: print the contract and example gains")
    parser.add_argument("file", type=Path, help="weights file (.safetensors)")


def run(args: argparse.Namespace) -> int:
    """Print one file."""
    try:
        policy = read_gains_file(args.file)
    except GainsFileError as error:
        raise UserError(str(error)) from error
    console = terminal()
    console.print(contract_table(policy, args.file))
    console.print(gains_table(policy))
    return 0


def contract_table(policy: Policy, file: Path) -> Table:
    """What the file promises."""
    c = policy.contract
    table = Table("", "", title=cell(file), title_justify="left", box=SIMPLE, show_header=False)
    numbers = sum(tensor.size for tensor in policy.tensors.values())
    kind = (
        "-".join(map(str, c.layers)) + f", {c.activation}, tanh" if c.layers else "constant gains"
    )
    rows = [
        ("network", f"{kind}; {numbers} numbers"),
        ("inputs", ", ".join(f"{i.name} / {i.scale:g} {i.unit}" for i in c.inputs)),
        ("gains", ", ".join(f"{o.name} [{o.low:g}, {o.high:g}]" for o in c.outputs)),
        ("control period", f"{c.control_period:g} s"),
        ("lookahead", f"{c.lookahead:g} m"),
        ("robot hash", c.robot_hash or "any robot"),
        ("training seed", "none" if c.training_seed is None else str(c.training_seed)),
        ("note", c.note),
        ("control law", ", ".join(f"{k} {v:g}" for k, v in vars(c.limits).items())),
        ("guidance", ", ".join(f"{k} {v}" for k, v in vars(c.guidance).items())),
    ]
    for row in rows:
        table.add_row(*map(cell, row))
    return table


def gains_table(policy: Policy) -> Table:
    """Gains at rest on the path, off it, and so on."""
    table = Table("situation", title="Gains", title_justify="left", box=SIMPLE)
    for output in policy.contract.outputs:
        table.add_column(output.name, justify="right")
    inputs = policy.contract.inputs or INPUTS
    for name, heading, speed_error, cross_track, wanted in SITUATIONS:
        values = (0.0, wanted - speed_error, wanted, heading, speed_error, cross_track)
        gains = policy.gains(np.array(policy_inputs(*values, np, inputs)))
        table.add_row(name, *(f"{float(g):.4f}" for g in gains))
    return table
