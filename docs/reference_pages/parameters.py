"""The page of the nodes' parameters: fields, defaults, comments and ranges of their dataclasses."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import io
import re
import tokenize
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
)
from fish_control.fusion import FusionConfig
from fish_control.node_configs import ControllerConfig, ExciterConfig, PlannerConfig
from fish_description.joint_angles import JointAnglesConfig
from fish_hw.settings.camera import CameraSettings
from fish_hw.settings.fake_robot import FakeRobotSettings
from fish_hw.settings.imu import ImuSettings
from fish_hw.settings.rotor import RotorSettings
from fish_hw.settings.rudder import RudderSettings
from fish_sim.camera.config import CameraConfig
from fish_sim.simulation_config import SimulatorConfig
from fish_vision.config import TrackerConfig
from reference_pages.markdown import HEADER, cell, escaped, table

CONFIGS: dict[str, type[Any]] = {
    "fish_sim/simulator": SimulatorConfig,
    "fish_sim/camera": CameraConfig,
    "fish_hw/rotor": RotorSettings,
    "fish_hw/rudder": RudderSettings,
    "fish_hw/imu": ImuSettings,
    "fish_hw/camera": CameraSettings,
    "fish_hw/fake_robot": FakeRobotSettings,
    "fish_vision/tracker": TrackerConfig,
    "fish_control/fusion": FusionConfig,
    "fish_control/planner": PlannerConfig,
    "fish_control/controller": ControllerConfig,
    "fish_control/exciter": ExciterConfig,
    "fish_bag/recorder": RecorderConfig,
    "fish_bag/replayer": ReplayerConfig,
    "fish_description/joint_angles": JointAnglesConfig,
}
SPECS = (*SIMULATED, *REAL, FAKE[0], *CONTROL, EXCITER, RECORDER, REPLAYER, JOINT_ANGLES)
INTRODUCTION = """# Parameters of the nodes

A node reads its parameters once, when it starts, and refuses a value that it cannot use with one line: name, value and
what is allowed. `ros2 param set` is refused: start the node again. The files `config/NODE.yaml` of each package list
the same parameters with their defaults. The column "allowed" says what the node itself answers to a wrong value.
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
    comments = field_comments(kind)
    rows = (
        (
            f"`{field.name}`",
            shown(getattr(kind(), field.name)),
            cell(comments.get(field.name, "")),
            cell(allowed(kind, field.name)),
        )
        for field in dataclasses.fields(kind)
    )
    head = ("parameter", "default", "unit and meaning", "allowed")
    return f"## {package} {executable}\n\n{escaped(summary)}\n\n{table(head, rows)}"


def field_comments(kind: type[Any]) -> dict[str, str]:
    """Field name -> the comment beside its definition, of a dataclass and its bases."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            found |= _comments_of_class(inspect.getsource(base))
    return found


def _comments_of_class(source: str) -> dict[str, str]:
    """Comments between the start of a field and the start of the next one."""
    found: dict[str, list[str]] = {}
    name = ""
    for token in tokenize.generate_tokens(io.StringIO(inspect.cleandoc(source)).readline):
        if token.type == tokenize.NAME and token.start[1] == 4:
            field = re.match(r"    (\w+) *:", token.line)
            name = field[1] if field else ""
        elif token.type == tokenize.COMMENT and name:
            found.setdefault(name, []).append(token.string.lstrip("# ").strip())
    return {field: " ".join(texts) for field, texts in found.items()}


def shown(value: object) -> str:
    """A default as YAML writes it."""
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    if isinstance(value, tuple):
        return "see file" if len(value) > 6 else f"`{list(value)}`".replace("'", "")
    return f"`{value}`" if value != "" else "empty"


def allowed(kind: type[Any], name: str) -> str:
    """What a dataclass says it expects when this field is far out of range; empty if it accepts anything."""
    like = getattr(kind(), name)
    if isinstance(like, bool):
        return "true, false"
    wrong: tuple[object, ...] = (1e300, -1e300)
    if isinstance(like, int):
        wrong = (10**9, -(10**9))
    elif isinstance(like, str):
        wrong = ("?",)
    elif not isinstance(like, float):
        return ""
    for value in wrong:
        try:
            kind(**{name: value})
        except (ValueError, OSError) as error:
            message = str(error)
            said = re.search(r"(?:expected|known:) (?:one of )?(.+)$", message)
            if said and message.startswith(name):
                return said[1].replace("a finite number, ", "")
    return ""
