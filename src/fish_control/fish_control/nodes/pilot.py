# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes fusion, planner and controller in one process: their messages to each other leave it no more.

    pilot --ros-args -r __ns:=/fish --fusion --params-file fusion.yaml --planner -p path:=S --controller

What follows --fusion, --planner or --controller are ROS arguments of that node, what comes before them or after --all is for all
three. The nodes,
their topics and parameters are those of the single executables. When one of them cannot go on, all three end: the motors
stop because nothing commands them.
"""

import sys
from collections.abc import Sequence
from functools import partial
from typing import Any

from fish_control.nodes.controller import ControllerNode
from fish_control.nodes.fusion import FusionNode
from fish_control.nodes.planner import PlannerNode
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import Part, run_together

NODES = ("fusion", "planner", "controller")


def split_arguments(words: Sequence[str]) -> tuple[list[str], dict[str, list[str]]]:
    """ROS arguments for all nodes, and those of each."""
    own: dict[str, list[str]] = {name: ["--ros-args"] for name in ("all", *NODES)}
    target = "all"
    for word in words:
        if word.startswith("--") and word[2:] in own:
            target = word[2:]
        elif word != "--ros-args":
            own[target].append(word)
    return own.pop("all"), own


def main() -> int:
    """Entry point."""
    common, own = split_arguments(sys.argv[1:])
    parts: list[Part[Any]] = [
        Part(partial(FusionNode, cli_args=own["fusion"]), "fusion"),
        Part(partial(PlannerNode, cli_args=own["planner"]), "planner", PlannerNode.end),
        Part(partial(ControllerNode, cli_args=own["controller"]), "controller"),
    ]
    return run_together(parts, common, spin=ByEvents())
