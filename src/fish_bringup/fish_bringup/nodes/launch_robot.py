# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the launch files have in common: arguments, the nodes of a robot or of one computer, what follows from a node's end.

A node that ends, ends the launch with it, so that nothing swims half: with respawn:=true it is started again instead. The
recorder and the live view may end without the rest.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fish_bringup.node_table import (
    CONTROL,
    EXCITER,
    FAKE,
    LAGS,
    NAMESPACE,
    PARTS,
    PILOT,
    REAL,
    RECORDER,
    ROBOTS,
    SIMULATED,
    VIEW,
    NodeSpec,
    composed,
    fake_parameters,
    frame_prefix,
    in_part,
    is_usual,
    middleware,
    open_loop,
    parameter_path,
    ros_parameters,
)

PLANNER = CONTROL[2]
RESPAWN_DELAY = 1.0  # s
IN_FILE = "; without it what planner.yaml says"
IN_PROGRAM = "; without it what exciter.yaml says"
ARGUMENTS = {
    "robot": (
        "sim",
        "sim, fake (the real drivers on emulated devices, the simulator behind them), or real",
    ),
    "part": ("all", "all, or of the real robot: fish, shore (two computers), drivers"),
    "config": ("", "folder of parameter files that override the installed ones of the same name"),
    "namespace": (
        NAMESPACE.strip("/"),
        "namespace of all nodes, relative; in another one than fish, clock and frames are the robot's own",
    ),
    "path": ("", f"letter or path family{IN_FILE}"),
    "path_args": (
        "",
        f"YAML, arguments of the path family: '{{radius: 0.6}}', '{{}}' for none{IN_FILE}",
    ),
    "speed": ("", f"surge speed, m/s{IN_FILE}"),
    "program": ("", "program of stroke and rudder to swim open loop, instead of path and speed"),
    "begin": ("", f"s of the program's time{IN_PROGRAM}"),
    "end": ("", f"s of the program's time; 0: its end{IN_PROGRAM}"),
    "use_sim_time": ("", "true: nodes follow /clock; without it what their files say"),
    "real_time_factor": (
        "",
        "simulated seconds in a second, of robot:=sim and robot:=fake; every node follows /clock; without it what "
        "simulator.yaml says",
    ),
    "compose": (
        "false",
        "true: fusion, planner and controller in one process, for two thirds of the processor time; they end together",
    ),
    "record": ("true", "false: no recorder"),
    "view": ("false", "true: the live view in a browser, on this computer"),
    "respawn": ("false", "true: a node that ends is started again; false: its end ends the launch"),
    "local": (
        "false",
        "true: messages stay on this computer (the loopback profile of fish_bringup)",
    ),
}
# parameter of a node: argument that gives it, its type; every node has the first
OF_EVERY_NODE = {"use_sim_time": ("use_sim_time", bool)}
FACTOR: dict[str, tuple[str, type]] = {"real_time_factor": ("real_time_factor", float)}
OF_NODE: dict[NodeSpec, dict[str, tuple[str, type]]] = {
    PLANNER: {"path": ("path", str), "path_args": ("path_args", str), "speed": ("speed", float)},
    SIMULATED[0]: FACTOR,
    FAKE[1]: FACTOR,
    EXCITER: {"program_file": ("program", str), "begin": ("begin", float), "end": ("end", float)},
}
DISPENSABLE = (RECORDER, VIEW)  # the robot swims on without them


def describe(**fixed: str) -> LaunchDescription:
    """Arguments, then the nodes; `fixed` arguments are no longer the user's choice."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
        if name not in fixed
    ]

    def nodes(context: LaunchContext) -> list[object]:
        """What the arguments ask for; a namespace may have been pushed around the file."""
        chosen = {
            name: fixed.get(name) or LaunchConfiguration(name).perform(context)
            for name in ARGUMENTS
        }
        pushed = getattr(context, "launch_configurations", {}).get("ros_namespace", "")
        full = f"{pushed}/{chosen['namespace']}"
        specs = _chosen(chosen)
        local = [SetEnvironmentVariable(*pair) for pair in middleware().items()]
        return [
            *(local if _yes(chosen["local"]) else []),
            *(_node(spec, chosen, full) for spec in specs),
        ]

    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])


def _chosen(chosen: Mapping[str, str]) -> list[NodeSpec]:
    """The nodes that the arguments ask for."""
    robot, part = chosen["robot"], chosen["part"]
    if robot not in ROBOTS:
        raise RuntimeError(f"robot:={robot} is unknown; known: {', '.join(ROBOTS)}")
    if part not in PARTS or (robot != "real" and part != "all"):
        raise RuntimeError(
            f"part:={part} of robot:={robot} is unknown; known: all, and of robot:=real {', '.join(PARTS[1:])}"
        )
    if robot == "real" and chosen["real_time_factor"]:
        raise RuntimeError(
            f"real_time_factor:={chosen['real_time_factor']} is for robot:=sim and robot:=fake; a real robot's time is real"
        )
    whole = open_loop(ROBOTS[robot]) if chosen["program"] else ROBOTS[robot]
    specs = [spec for spec in whole if in_part(spec, part)]
    if robot == "real" and REAL[0] in specs and chosen["use_sim_time"].lower() == "true":
        raise RuntimeError(
            "use_sim_time:=true is for robot:=sim and robot:=fake; a real motor needs real time"
        )
    if not _yes(chosen["record"]):
        specs = [spec for spec in specs if spec != RECORDER]
    if _yes(chosen["view"]):
        specs.append(VIEW)
    compose, config = _yes(chosen["compose"]) and set(PILOT.parts) <= set(specs), chosen["config"]
    if config and not any(_own(spec, config) for spec in specs):
        expected = ", ".join(spec.parameter_file for spec in specs)
        raise RuntimeError(
            f"config:={config} holds none of the nodes' parameter files; expected some of {expected}"
        )
    return list(composed(specs)) if compose else specs


def _node(spec: NodeSpec, chosen: Mapping[str, str], full: str) -> Node:
    """One node; `full` is its namespace with what was pushed around it."""
    respawn = _yes(chosen["respawn"])
    second = not is_usual(full)
    ends_all = spec not in DISPENSABLE and not respawn
    return Node(
        package=spec.package,
        executable=spec.executable,
        namespace=chosen["namespace"],
        arguments=_arguments(spec, chosen, full),
        parameters=[] if spec.parts else _parameters(spec, chosen, full),
        remappings=[
            *([("/clock", "clock")] if second else []),
            *(tuple(rule.split(":=")) for rule in spec.remaps),
        ],
        respawn=respawn,
        respawn_delay=RESPAWN_DELAY,
        output="screen",
        on_exit=Shutdown(reason=f"{spec.name} ended") if ends_all else None,
    )


def _parameters(spec: NodeSpec, chosen: Mapping[str, str], full: str) -> list[object]:
    """Files and single values of a node; what comes later overrides what comes before."""
    given = _given(spec, chosen)
    return [*_files(spec, chosen, full), *([given] if given else [])]


def _files(spec: NodeSpec, chosen: Mapping[str, str], full: str) -> list[Any]:
    """Files of a node and what follows from the robot's kind and place; what comes later overrides what comes before.

    A robot's own file must not lead the drivers of a fake robot to real devices.
    """
    prefixed = spec.frames and not is_usual(full)
    devices = Path(tempfile.gettempdir()) / f"{full.strip('/').replace('/', '_')}_devices"
    fake = fake_parameters(devices).get(spec) if chosen["robot"] == "fake" else None
    return [
        str(parameter_path(spec)),
        *([{"frame_prefix": frame_prefix(full)}] if prefixed else []),
        *_own(spec, chosen["config"]),
        *([fake] if fake else []),
        *([{"use_sim_time": True}] if chosen["real_time_factor"] else []),
        *([LAGS] if chosen["real_time_factor"] and spec == FAKE[1] else []),
    ]


def _arguments(spec: NodeSpec, chosen: Mapping[str, str], full: str) -> list[str]:
    """Of an executable of several nodes: files and single values of each; what launch adds after them is for all."""
    words: list[str] = []
    for part in spec.parts:
        words.append(f"--{part.executable}")
        values = {name: _value(chosen[word], kind) for name, (word, kind) in _wanted(part, chosen)}
        for given in [*_files(part, chosen, full), values]:
            words += ros_parameters(given) if isinstance(given, dict) else ["--params-file", given]
    return [*words, "--all"] if words else words


def _value(text: str, kind: type) -> object:
    return _yes(text) if kind is bool else kind(text)


def _given(spec: NodeSpec, chosen: Mapping[str, str]) -> dict[str, ParameterValue]:
    """What the arguments say of a node's parameters."""
    return {
        parameter: ParameterValue(LaunchConfiguration(argument), value_type=kind)
        for parameter, (argument, kind) in _wanted(spec, chosen)
    }


def _wanted(spec: NodeSpec, chosen: Mapping[str, str]) -> list[tuple[str, tuple[str, type]]]:
    """Parameters that an argument gives; one that nobody gave must not override the robot's own file."""
    known = {**OF_EVERY_NODE, **OF_NODE.get(spec, {})}
    return [(name, of) for name, of in known.items() if chosen[of[0]]]


def _own(spec: NodeSpec, config: str) -> list[str]:
    """The robot's own file for a node, if there is one; a file camera.yaml is the driver's, not the drawn picture's."""
    file = Path(config).expanduser() / spec.parameter_file
    return [str(file)] if config and file.exists() and spec not in FAKE else []


def _yes(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise RuntimeError(f"got {text!r}, expected true or false")
    return text.lower() == "true"
