# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of topics and services: who publishes and takes what, read from the nodes' source."""

from __future__ import annotations

import ast
import importlib.util
from collections import defaultdict
from pathlib import Path

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
from reference_pages import HEADER, cell, table

SPECS = (*SIMULATED, *REAL, FAKE[0], *CONTROL, EXCITER, RECORDER, REPLAYER, JOINT_ANGLES, VIEW)
DRIVE = "fish_bringup", "operator"  # package and module of what the verb drive publishes and takes
BY_NAME = ("fish_node.nodes.arming", "fish_node.nodes.frames")
CREATORS = {
    "create_publisher": "publishes",
    "create_subscription": "takes",
    "hear": "takes",
    "create_service": "serves",
}
MEANING = {
    "joint_command": "rotor: phase [rad] and speed [rad/s]; rudder: angle [rad]; 100 Hz",
    "joy": "axes and buttons of a gamepad, from joy_node of the full ROS 2",
    "lockstep": "whom a simulator in lockstep waits for: how far somebody (frame_id) is (stamp)",
    "joint_states": "encoder of the rotor: angle [rad], speed [rad/s]; 100 Hz",
    "imu/data": "turn rate [rad/s], specific force [m/s^2], orientation, in imu_link; 100 Hz",
    "camera/image_raw/compressed": "the pool from above, JPEG; 30 Hz",
    "camera/image_raw": "the same without compression, where publish_raw is set",
    "camera/camera_info": "lens and size of the picture; 30 Hz",
    "camera/pose": "head in the pool [m, rad] with covariance; 30 Hz",
    "camera/tail": "angles of the tail's links [rad]; 30 Hz",
    "camera/debug/compressed": "the picture with what the tracker found, where debug_image is set",
    "odometry/filtered": "estimated pose in pool [m, rad] and velocity in base_link [m/s, rad/s]; 100 Hz",
    "reference/path": "the wanted path in pool [m]; on change, transient local",
    "reference/speed": "the wanted surge speed [m/s]; on change, transient local",
    "control/target": "lookahead point [m] and course [rad] in pool; 50 Hz",
    "control/twist": "wanted speed [m/s] and turn rate [rad/s]; 50 Hz",
    "control/gains": "Kp, Ki, Kd of steering, then of speed; 50 Hz",
    "tracking/error": "cross-track [m], heading [rad], speed [m/s]; 50 Hz",
    "description/joint_states": "every joint for robot_state_publisher: rotor, rudder, tail [rad]; 30 Hz",
    "arming/state": "level OK: armed, else the message is the reason; 20 Hz and on change",
    "arming/disarm": "a node's reason to disarm; when it has one",
    "arming/pause": "why a node pauses its commands, repeated while it does; empty: it goes on",
    "operator/estop": "true while the emergency stop is pressed; on change",
    "operator/deadman": "true while the operator holds it; 10 Hz, where deadman_timeout_s is set",
    "rudder/trouble": "empty, or why the rudder does not work; 20 Hz",
    "fake/joint_command": "what the fake robot's rotor and rudder do; 100 Hz",
    "fake/imu": "what the simulator feels, for the fake robot's IMU; 100 Hz",
    "fake/image/compressed": "what the simulator draws, for the fake robot's camera; 30 Hz",
    "fake/battery_state": "the simulator's battery, for the fake robot's rotor module; 1 Hz",
    "fake/lockstep": "how far rotor driver, controller and tracker (frame_id) are (stamp), with simulated time",
    "fake/fault": "name of a fault of the fake robot, or mend",
    "battery_state": "voltage [V], current [A]; 1 Hz",
    "sim/odometry": "the simulator's true pose and velocity; 100 Hz",
    "sim/joint_states": "the simulator's true rudder and tail angles [rad]; 100 Hz",
    "/tf": "pool to base_link, where tf2_msgs is installed; 100 Hz",
    "/tf_static": "base_link to imu_link, pool to the camera, where tf2_msgs is installed; once, transient local",
    "path/status": "waiting, executing, succeeded or canceled, with progress and cross-track error [m]; 1 Hz and on change",
    "/diagnostics": "state of every node; 1 Hz and on change",
    "/clock": "simulated time",
    "pause": "stops and continues simulated time",
    "path/start": "follows the path from its beginning",
    "path/cancel": "gives the path up: the fish glides to a stop",
    "reset": "puts the simulated fish back to its start",
    "arm": "true arms the robot, false disarms it; refused with everything that speaks against it",
    "~/clear_faults": "erases the rotor module's faults",
    "camera/set_camera_info": "saves a calibration in calibration_file and uses it; camera_calibration's COMMIT",
    "~/pause": "stops and continues a replay",
}
INTRODUCTION = """# Topics, services, frames

Topics are relative to the robot's namespace, `/fish` by default; a leading `/` is absolute. All are of common
interfaces, in SI units and radians. The simulator and the drivers publish and take the same topics, so that vision and
control cannot tell them apart. "camera" below is the node of `fish_sim` or of `fish_hw`.

Frames follow REP 103. `pool` has its origin in the middle of the pool (4.27 m x 2.13 m, or `FISH_POOL`), x along the long
side, y along the short side, z up. `base_link` is at the head's centre of mass, x forward, y left. Angles are counter-clockwise
positive. A positive rudder angle steers left.
"""


def page() -> str:
    """Topics, then services."""
    found: dict[str, dict[tuple[str, str], set[str]]] = defaultdict(lambda: defaultdict(set))
    for spec in SPECS:
        for role, message, topic in interfaces(spec.package, spec.executable):
            found[role][topic, message].add(spec.name)
    for role, message, topic in interfaces(*DRIVE):
        found[role][topic, message].add(f"{DRIVE[0]}/robofish drive")
    topics = sorted({*found["publishes"], *found["takes"]}, key=lambda key: key[0].lstrip("/"))
    rows = (
        (
            f"`{topic}`",
            cell(f"{message}: {MEANING[topic]}"),
            nodes(found["publishes"][topic, message]),
            nodes(found["takes"][topic, message]),
        )
        for topic, message in topics
    )
    services = (
        (f"`{name}`", cell(kind), cell(MEANING[name]), nodes(servers))
        for (name, kind), servers in sorted(found["serves"].items())
    )
    return "\n".join(
        [
            HEADER,
            INTRODUCTION,
            "## Topics\n",
            table(("topic", "type: content, rate", "published by", "taken by"), rows),
            "The recorder takes the topics that its parameter `topics` names. The replayer publishes those of a recording.\n",
            "## Services\n",
            table(("service", "type", "what", "node"), services),
        ]
    )


def nodes(names: set[str]) -> str:
    """Executables in a cell; the camera is that of fish_sim or of fish_hw."""
    every = len(names) > 8
    return "every node" if every else ", ".join(sorted({name.split("/")[1] for name in names}))


def interfaces(package: str, executable: str) -> list[tuple[str, str, str]]:
    """(role, type, name) of a node: of its own module and of the nodes' modules that it imports."""
    todo, done = [f"{package}.nodes.{executable}"], set()
    found = []
    while todo:
        module = todo.pop()
        done.add(module)
        source = Path(str(importlib.util.find_spec(module).origin))  # type: ignore[union-attr]
        tree = ast.parse(source.read_text(encoding="utf-8"))
        types = imported_types(tree)
        for node in ast.walk(tree):
            found += interface(node, types)
            if isinstance(node, ast.ImportFrom) and node.module:
                near = node.module.rpartition(".")[0]
                if node.module in BY_NAME:
                    found += named_interfaces(node.module, {alias.name for alias in node.names})
                elif near in (f"{package}.nodes", "fish_node.nodes") and node.module not in done:
                    todo.append(node.module)
    return found


def named_interfaces(module: str, names: set[str]) -> list[tuple[str, str, str]]:
    """(role, type, name) of the classes and functions that a node imports from a module."""
    path = Path(str(importlib.util.find_spec(module).origin))  # type: ignore[union-attr]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    types = imported_types(tree)
    return [
        found
        for owner in tree.body
        if isinstance(owner, ast.ClassDef | ast.FunctionDef) and owner.name in names
        for node in ast.walk(owner)
        for found in interface(node, types)
    ]


def imported_types(tree: ast.AST) -> dict[str, str]:
    """Name in the module -> package/Type of the message or service."""
    return {
        alias.asname or alias.name: f"{node.module.partition('.')[0]}/{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        and node.module
        and node.module.endswith((".msg", ".srv"))
        for alias in node.names
    }


def interface(node: ast.AST, types: dict[str, str]) -> list[tuple[str, str, str]]:
    """What a call creates, where type and name stand in it."""
    match node:
        case ast.Call(
            func=ast.Attribute(attr=creator), args=[ast.Name(kind), ast.Constant(name), *_]
        ):
            pass
        case ast.Call(func=ast.Name(creator), args=[_, ast.Name(kind), ast.Constant(name), *_]):
            pass
        case _:
            return []
    if creator not in CREATORS or kind not in types:
        return []
    return [(CREATORS[creator], types[kind], str(name))]
