# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Real nodes for tests across packages: processes of the built workspace, each set on an own ROS domain."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from fish_bringup.node_table import (
    CONTROL,
    NAMESPACE,
    RECORDER,
    SIMULATED,
    NodeSpec,
)
from fish_bringup.nodes.watch import WatchNode, watching
from fish_bringup.processes import NodeProcesses
from fish_bringup.run_watch import check_running
from fish_node.domain import choose_domain

SIMULATOR, CAMERA = SIMULATED
TRACKER, FUSION, PLANNER, CONTROLLER = CONTROL
PATIENCE = 120.0  # s of real time in which anything waited for must happen


def pytest_configure() -> None:
    """Say at once what is missing instead of failing in every test."""
    if "fish_bringup" not in os.environ.get("AMENT_PREFIX_PATH", ""):
        raise pytest.UsageError(
            "the workspace is not sourced: make test, or source install/setup.bash first"
        )


@dataclass
class Run:
    """A robot that swims, and the eyes on it."""

    domain: int
    nodes: NodeProcesses
    watch: WatchNode
    listen: Callable[[float], None]
    parameters: dict[NodeSpec, dict[str, object]]

    def start(self, spec: NodeSpec) -> None:
        """Start a node, or start it again."""
        self.nodes.start(spec, self.parameters[spec])

    def until(self, there: Callable[[], bool], what: str) -> None:
        """Listen until something is so, and keep the robot armed; every node must be alive meanwhile."""
        deadline = time.monotonic() + PATIENCE
        while not there():
            if time.monotonic() > deadline:
                pytest.fail(f"{what} did not come within {PATIENCE:.0f} s; seen: {self.seen()}")
            if self.watch.disarmed:
                self.watch.ask_to_arm()
            self.listen(0.05)
            check_running(self.nodes)

    def seen(self) -> str:
        """What was last heard of robot and nodes, and what the nodes logged, for a message."""
        logged = {
            process.spec.name: process.last_words() for process in self.nodes.running.values()
        }
        return f"{self.watch.sight}, {self.watch.levels}, {self.watch.diagnostics}, {logged}"

    def progress(self) -> float:
        """Arc length along the path [m], followed in order."""
        return self.watch.tracker.update((self.watch.sight.x, self.watch.sight.y)).progress

    def finished(self) -> bool:
        """Whether the end of the path is reached."""
        return self.watch.tracker.update((self.watch.sight.x, self.watch.sight.y)).finished


def parameters(
    folder: Path,
    path: str,
    path_args: str,
    start: tuple[float, float, float],
    factor: float,
    lockstep: float = 0.0,
) -> dict[NodeSpec, dict[str, object]]:
    """Nodes of a run without images, `factor` times real time: camera poses come from the simulator."""
    x, y, heading = start
    sim_time = {"use_sim_time": True}
    return {
        RECORDER: {"output": str(folder), "name": "recording"},
        SIMULATOR: {
            "camera": "pose",
            "real_time_factor": factor,
            "lockstep": lockstep,
            **{"start_x": x, "start_y": y, "start_heading": heading},
        },
        FUSION: dict(sim_time),
        PLANNER: {**sim_time, "path": path, "path_args": path_args},
        CONTROLLER: dict(sim_time),
    }


@contextmanager
def running(
    folder: Path,
    settings: dict[NodeSpec, dict[str, object]],
    *,
    swims: bool = True,
    domain: int | None = None,
    namespace: str = NAMESPACE,
) -> Iterator[Run]:
    """Start the nodes, on a free domain unless one is given; with `swims` the fish has path and estimate when this returns."""
    domain = choose_domain() if domain is None else domain
    with (
        NodeProcesses(domain, folder / "logs", namespace) as nodes,
        watching(domain, namespace) as (watch, listen),
    ):
        run = Run(domain, nodes, watch, listen, settings)
        for spec in settings:
            if spec != CONTROLLER:
                run.start(spec)
        run.until(lambda: watch.sees(RECORDER.executable), "the recorder")
        if swims:
            run.start(CONTROLLER)
            run.until(
                lambda: watch.sight is not None and watch.tracker is not None, "odometry and path"
            )
        yield run
