# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of the nodes' parameters: fields, defaults, comments and ranges of their dataclasses."""

from __future__ import annotations

import dataclasses
import importlib
from types import ModuleType
from typing import Any

from fish_bag.playback import ReplayerConfig
from fish_bag.recorder_config import RecorderConfig
from fish_bringup.node_table import (
    CONTROL,
    EXCITER,
    FAKE,
    JOINT_ANGLES,
    REAL,
    RECORDER,
    REPLAYER,
    SIMULATED,
    VIEW,
)
from fish_bringup.view_state import ViewConfig
from fish_control.node_configs import (
    ControllerConfig,
    ExciterConfig,
    FusionNodeConfig,
    PlannerConfig,
)
from fish_description.joint_angles import JointAnglesConfig
from fish_hw.settings import (
    CameraSettings,
    FakeRobotSettings,
    ImuSettings,
    RotorSettings,
    RudderSettings,
)
from fish_node.parameters import parameter_docs
from fish_sim.camera.config import CameraConfig
from fish_sim.simulation_config import SimulatorConfig
from fish_vision.config import TrackerConfig
from reference_pages import HEADER, cell, escaped, table

CONFIGS: dict[str, type[Any]] = {
    "fish_bringup/live_view": ViewConfig,
    "fish_sim/simulator": SimulatorConfig,
    "fish_sim/camera": CameraConfig,
    "fish_hw/rotor": RotorSettings,
    "fish_hw/rudder": RudderSettings,
    "fish_hw/imu": ImuSettings,
    "fish_hw/camera": CameraSettings,
    "fish_hw/fake_robot": FakeRobotSettings,
    "fish_vision/tracker": TrackerConfig,
    "fish_control/fusion": FusionNodeConfig,
    "fish_control/planner": PlannerConfig,
    "fish_control/controller": ControllerConfig,
    "fish_control/exciter": ExciterConfig,
    "fish_bag/recorder": RecorderConfig,
    "fish_bag/replayer": ReplayerConfig,
    "fish_description/joint_angles": JointAnglesConfig,
}
SPECS = (*SIMULATED, *REAL, FAKE[0], *CONTROL, EXCITER, RECORDER, REPLAYER, JOINT_ANGLES, VIEW)
INTRODUCTION = """# Parameters of the nodes

A node refuses a value that it cannot use with one line: name, value and what is allowed. These can be set while it runs:
`speed`, `path`, `path_args` and `end` of the planner, the limits of the gains of the controller, the colours of the tracker.
All others are read-only: start the node again. The files `config/NODE.yaml` of each package list the same parameters with
their defaults. The column "allowed" says what the node itself answers to a wrong value. `ros2 param describe` shows the same
text.
"""


def page() -> str:
    """All nodes of the node table."""
    names = [spec.name for spec in SPECS]
    if set(names) != set(CONFIGS):
        raise ValueError(
            f"node table and CONFIGS differ: {sorted(set(names).symmetric_difference(CONFIGS))}"
        )
    return "\n".join([HEADER, INTRODUCTION, *(section(name) for name in names)])


def section(name: str) -> str:
    """One node."""
    package, executable = name.split("/")
    module: ModuleType = importlib.import_module(f"{package}.nodes.{executable}")
    summary = (module.__doc__ or "").partition("\n")[0]
    kind = CONFIGS[name]
    docs = parameter_docs(kind())
    rows = (
        (
            f"`{field.name}`",
            shown(getattr(kind(), field.name)),
            cell(docs[field.name].description),
            cell(docs[field.name].allowed),
        )
        for field in dataclasses.fields(kind)
    )
    head = ("parameter", "default", "unit and meaning", "allowed")
    return f"## {package} {executable}\n\n{escaped(summary)}\n\n{table(head, rows)}"


def shown(value: object) -> str:
    """A default as YAML writes it."""
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    if isinstance(value, tuple):
        return "see file" if len(value) > 6 else f"`{list(value)}`".replace("'", "")
    return f"`{value}`" if value != "" else "empty"
