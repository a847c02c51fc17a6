# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The one table of the robot's nodes, and how each is started.

The pip-only starter (`processes.py`, used by `robofish demo` and the tests) and launch/fish.launch.py
read it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)

from fish_report.errors import UserError

NAMESPACE = "/fish"
FAST_DDS, PROFILE = "rmw_fastrtps_cpp", "FASTRTPS_DEFAULT_PROFILES_FILE"
Parameters = Mapping[str, object]


@dataclass(frozen=True)
class NodeSpec:
    """An installed executable and the parameter file it is started with.

    Attributes:
        parameter_file: in config/ of the package's share directory.
        frames: whether it has the parameter frame_prefix.
        remaps: rules "from:=to" of topics, services and of the node's name (__node).
        parts: the nodes of an executable that is several; it has no parameters of its own.
    """

    package: str
    executable: str
    parameter_file: str
    frames: bool = False
    remaps: tuple[str, ...] = ()
    parts: tuple[NodeSpec, ...] = ()

    @property
    def name(self) -> str:
        """For people and log files: package/executable."""
        return f"{self.package}/{self.executable}"


SIMULATED = (
    NodeSpec("fish_sim", "simulator", "simulator.yaml", frames=True),
    NodeSpec("fish_sim", "camera", "camera.yaml", frames=True),
)
REAL = (
    NodeSpec("fish_hw", "rotor", "rotor.yaml", frames=True),
    NodeSpec("fish_hw", "rudder", "rudder.yaml"),
    NodeSpec("fish_hw", "imu", "imu.yaml", frames=True),
    NodeSpec("fish_hw", "camera", "camera.yaml", frames=True),
)
CONTROL = (
    NodeSpec("fish_vision", "tracker", "tracker.yaml", frames=True),
    NodeSpec("fish_control", "fusion", "fusion.yaml", frames=True),
    NodeSpec("fish_control", "planner", "planner.yaml", frames=True),
    NodeSpec("fish_control", "controller", "controller.yaml"),
)
PILOT = NodeSpec("fish_control", "pilot", "", parts=CONTROL[1:])  # what is here one process
EXCITER = NodeSpec("fish_control", "exciter", "exciter.yaml")
RECORDER = NodeSpec("fish_bag", "recorder", "recorder.yaml")
REPLAYER = NodeSpec("fish_bag", "replayer", "replayer.yaml")
JOINT_ANGLES = NodeSpec("fish_description", "joint_angles", "joint_angles.yaml")

# The real drivers on the devices of a fake robot: the simulated pool lies behind the devices, and what it measures and
# draws reaches the robot's topics through the drivers alone.
BEHIND = tuple(
    f"{name}:=fake/{name.rpartition('/')[2]}"
    for name in (
        "joint_command",
        "joint_states",
        "battery_state",
        "arm",
        "arming/state",
        "arming/disarm",
        "arming/pause",
    )
)
FAKE = (
    NodeSpec("fish_hw", "fake_robot", "fake_robot.yaml"),
    NodeSpec(
        "fish_sim",
        "simulator",
        "simulator.yaml",
        remaps=(*BEHIND, "imu/data:=fake/imu", "lockstep:=fake/lockstep"),
    ),
    NodeSpec(
        "fish_sim",
        "camera",
        "camera.yaml",
        remaps=(
            "__node:=fake_camera",
            "camera/image_raw/compressed:=fake/image/compressed",
            "camera/camera_info:=fake/camera_info",
        ),
    ),
)

# s, of a robot that hurts nobody: as the node simulator
BORNE = {"odometry_timeout_s": 0.5, "camera_timeout_s": 1.0, "pause_s": 1.0, "stale_s": 1.0}
BORNE_BY_RUDDER = {"stale_s": 1.0, "armed_timeout_s": 1.0}

# A simulator whose clock all nodes follow: time waits for nodes that lag by more than slack [s of simulated time], for so long
# [s of real time]. The camera's poses are late by its own delay, one lost picture, and the tracker; a fake robot says itself how
# far the tracker is.
LAGS = {"lockstep": 5.0, "lockstep_slack": 0.035}
PICTURES = {"lockstep_camera": 0.15}

HARDWARE = ("sim", "fake")  # what a run of this computer alone can swim with
VIEW = NodeSpec("fish_bringup", "live_view", "view.yaml")

ROBOTS = {
    "sim": (*SIMULATED, *CONTROL, RECORDER),
    "fake": (*FAKE, *REAL, *CONTROL, RECORDER),
    "real": (*REAL, *CONTROL, RECORDER),
}

IN_THE_FISH = REAL[:3]  # the camera hangs on the computer at the pool
PARTS = ("all", "fish", "shore", "drivers")  # what a launch file starts of a robot


def in_part(spec: NodeSpec, part: str) -> bool:
    """Whether a node runs in a part of the real robot: in the fish, on the computer at the pool, or as a driver."""
    if part == "drivers":
        return spec in REAL
    return part == "all" or (spec in IN_THE_FISH) == (part == "fish")


def robot_of(hardware: str) -> tuple[NodeSpec, ...]:
    """The nodes of "sim", the simulator, or of "fake", the real drivers on the devices of a fake robot.

    Raises:
        UserError: another name.
    """
    if hardware not in HARDWARE:
        raise UserError(f"hardware is {hardware!r}, expected one of {', '.join(HARDWARE)}")
    return ROBOTS[hardware]


def fake_parameters(devices: Path) -> dict[NodeSpec, dict[str, object]]:
    """What the nodes of a fake robot need to find its devices, which lie in a folder with a short name.

    Nothing real moves, so that lateness of a busy computer is borne for as long as in simulation.
    """
    fake_robot, simulator, _ = FAKE
    rotor, rudder, imu, camera = REAL
    lens = Path(get_package_share_directory("fish_vision")) / "config" / "simulated_camera.yaml"
    return {
        fake_robot: {"folder": str(devices)},
        simulator: {"estimate": "ignored"},
        rotor: {"port": str(devices / "rotor"), "battery_cells": 3, **BORNE},
        rudder: {"chip": str(devices / "pwmchip0"), **BORNE_BY_RUDDER},
        imu: {"bus": f"unix:{devices / 'i2c'}"},
        camera: {"device": f"unix:{devices / 'camera'}", "calibration_file": str(lens)},
    }


def open_loop(robot: Sequence[NodeSpec]) -> tuple[NodeSpec, ...]:
    """A robot's nodes with the exciter in the place of planner and controller."""
    return (*(spec for spec in robot if spec not in CONTROL[2:]), EXCITER)


def followers(robot: Sequence[NodeSpec]) -> tuple[NodeSpec, ...]:
    """A robot's nodes that follow /clock where time is simulated.

    Not the simulator, which says it, nor the recorder, whose time is the wall clock's: each would wake up for every tick.
    """
    return tuple(spec for spec in robot if spec.executable not in ("simulator", "recorder"))


def composed(robot: Sequence[NodeSpec]) -> tuple[NodeSpec, ...]:
    """A robot's nodes with fusion, planner and controller in one process."""
    return (*(spec for spec in robot if spec not in PILOT.parts), PILOT)


def executable_path(spec: NodeSpec) -> Path:
    """install/<package>/lib/<package>/<executable>, what `ros2 run` starts.

    Raises:
        UserError: not built, or the workspace is not sourced.
    """
    try:
        path = Path(get_package_prefix(spec.package)) / "lib" / spec.package / spec.executable
    except (PackageNotFoundError, OSError):  # OSError: AMENT_PREFIX_PATH is empty
        raise UserError(
            f"package {spec.package} is not in this shell's workspace; "
            "build it (make build) and source install/setup.bash"
        ) from None
    if not path.exists():
        raise UserError(f"{path} does not exist; build the workspace again (make build)")
    return path


def parameter_path(spec: NodeSpec) -> Path:
    """The installed parameter file."""
    return Path(get_package_share_directory(spec.package)) / "config" / spec.parameter_file


def command(
    spec: NodeSpec,
    parameters: Parameters | Mapping[NodeSpec, Parameters] | None = None,
    namespace: str = NAMESPACE,
) -> list[str]:
    """Command line of a process: parameter files, then single parameters that override them.

    A fish in another namespace than the usual one may be the second on its domain: its clock and its frames are its own.

    Args:
        parameters: of the node; of each part where the process has several.
    """
    line = [str(executable_path(spec)), "--ros-args", "-r", f"__ns:={namespace}"]
    for old, new in remappings(namespace):
        line += ["-r", f"{old}:={new}"]
    given: Mapping[Any, Any] = parameters or {}
    if not spec.parts:
        return line + arguments(spec, given, namespace)
    for part in spec.parts:
        line += [f"--{part.executable}", *arguments(part, given.get(part, {}), namespace)]
    return line


def arguments(spec: NodeSpec, parameters: Parameters, namespace: str) -> list[str]:
    """ROS arguments of one node."""
    line = [word for rule in spec.remaps for word in ("-r", rule)]
    line += ["--params-file", str(parameter_path(spec))]
    own = {"frame_prefix": frame_prefix(namespace)} if spec.frames else {}
    return line + ros_parameters({**own, **parameters})


def ros_parameters(parameters: Parameters) -> list[str]:
    """ROS arguments of single parameters. JSON is YAML, and keeps "N" a string and 1.0 a float."""
    given = [f"{name}:={json.dumps(value)}" for name, value in parameters.items()]
    return [word for item in given for word in ("-p", item)]


def remappings(namespace: str) -> tuple[tuple[str, str], ...]:
    """Absolute topics that a fish in another namespace than the usual one has to itself."""
    if is_usual(namespace):
        return ()
    return (("/clock", f"/{namespace.strip('/')}/clock"),)


def frame_prefix(namespace: str) -> str:
    """What stands before the names of frames: nothing for the usual namespace, otherwise the namespace."""
    return "" if is_usual(namespace) else f"{namespace.strip('/')}/"


def is_usual(namespace: str) -> bool:
    """Whether a namespace is the one that a fish has by itself."""
    return namespace.strip("/") == NAMESPACE.strip("/")


def middleware() -> dict[str, str]:
    """What keeps a robot's messages on this computer, and a node that was killed from making others deaf.

    Fast DDS: config/loopback.xml, and the discovery range left to it (LOCALHOST would add shared memory again).
    Another middleware, or a profile of the caller's own: the discovery range alone.
    """
    if os.environ.get("RMW_IMPLEMENTATION", FAST_DDS) == FAST_DDS:
        profile = str(Path(get_package_share_directory("fish_bringup")) / "config" / "loopback.xml")
        if os.environ.get(PROFILE, profile) == profile:
            return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", PROFILE: profile}
    return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def environment(domain: int) -> dict[str, str]:
    """The environment of every node: an own DDS domain on this machine only, one thread for small matrices.

    The ROS wheels start Python again with LD_LIBRARY_PATH set and leave a guard variable behind; a child
    gets both (inherited) or, where a caller dropped the path, neither.
    """
    env = dict(os.environ)
    env.update(middleware(), ROS_DOMAIN_ID=str(domain), PYTHONUNBUFFERED="1")
    env.setdefault("OMP_NUM_THREADS", "1")
    if not env.get("LD_LIBRARY_PATH"):
        env.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    return env
