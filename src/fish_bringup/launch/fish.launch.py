"""The whole robot with the full ROS 2: `ros2 launch fish_bringup fish.launch.py robot:=sim path:=R speed:=0.2`.

The same nodes with the same parameter files as the pip-only starter (fish_bringup.node_table); robot:=real takes
the drivers of fish_hw in place of simulator and simulated camera. config:=FOLDER holds this robot's own values: what stands
in FOLDER/rotor.yaml, tracker.yaml, ... overrides the installed file of that name, and an argument that is given here overrides
both. program:=diagnosis.json swims the proposed experiment open loop: the exciter takes the place of planner and controller.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fish_bringup.node_table import (
    CONTROL,
    EXCITER,
    NAMESPACE,
    ROBOTS,
    NodeSpec,
    open_loop,
    parameter_path,
)

PLANNER = CONTROL[2]
IN_FILE = "; without it what planner.yaml says"
IN_PROGRAM = "; without it what exciter.yaml says"
ARGUMENTS = {
    "robot": ("sim", "sim or real"),
    "config": ("", "folder of parameter files that override the installed ones of the same name"),
    "namespace": (NAMESPACE, "namespace of all nodes"),
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
}
# parameter of a node: argument that gives it, its type; every node has the first
OF_EVERY_NODE = {"use_sim_time": ("use_sim_time", bool)}
OF_NODE: dict[NodeSpec, dict[str, tuple[str, type]]] = {
    PLANNER: {"path": ("path", str), "path_args": ("path_args", str), "speed": ("speed", float)},
    EXCITER: {"program_file": ("program", str), "begin": ("begin", float), "end": ("end", float)},
}


def _node(spec: NodeSpec, config: str, context: LaunchContext) -> Node:
    given = _given(spec, context)
    return Node(
        package=spec.package,
        executable=spec.executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[str(parameter_path(spec)), *_own(spec, config), *([given] if given else [])],
        output="screen",
    )


def _given(spec: NodeSpec, context: LaunchContext) -> dict[str, ParameterValue]:
    """What the arguments say of a node's parameters; one that nobody gave must not override the robot's own file."""
    return {
        parameter: ParameterValue(LaunchConfiguration(argument), value_type=kind)
        for parameter, (argument, kind) in {**OF_EVERY_NODE, **OF_NODE.get(spec, {})}.items()
        if LaunchConfiguration(argument).perform(context)
    }


def _own(spec: NodeSpec, config: str) -> list[str]:
    """The robot's own file for a node, if there is one."""
    file = Path(config).expanduser() / spec.parameter_file
    return [str(file)] if config and file.exists() else []


def _nodes(context: LaunchContext) -> list[Node]:
    robot, program, config = (
        LaunchConfiguration(name).perform(context) for name in ("robot", "program", "config")
    )
    if robot not in ROBOTS:
        raise RuntimeError(f"robot:={robot} is unknown; known: {', '.join(ROBOTS)}")
    specs = open_loop(ROBOTS[robot]) if program else ROBOTS[robot]
    if config and not any(_own(spec, config) for spec in specs):
        expected = ", ".join(spec.parameter_file for spec in specs)
        raise RuntimeError(
            f"config:={config} holds none of the nodes' parameter files; expected some of {expected}"
        )
    return [_node(spec, config, context) for spec in specs]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the nodes of the chosen robot."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])
