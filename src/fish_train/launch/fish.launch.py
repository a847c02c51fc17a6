"""The whole robot with the full ROS 2: `ros2 launch fish_train fish.launch.py robot:=sim path:=R speed:=0.2`.

The same nodes with the same parameter files as the pip-only starter (fish_train.bringup); robot:=real takes
the drivers of fish_hw in place of simulator and simulated camera. config:=FOLDER holds this robot's own values: what stands
in FOLDER/rotor.yaml, tracker.yaml, ... overrides the installed file of that name. program:=diagnosis.json swims the proposed
experiment open loop: the exciter takes the place of planner and controller.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fish_train.bringup import CONTROL, EXCITER, NAMESPACE, ROBOTS, NodeSpec, open_loop, parameter_path

PLANNER = CONTROL[2]
ARGUMENTS = {
    "robot": ("sim", "sim or real"),
    "config": ("", "folder of parameter files that override the installed ones of the same name"),
    "namespace": (NAMESPACE, "namespace of all nodes"),
    "path": ("R", "letter or path family"),
    "path_args": ("", "YAML, arguments of the path family: '{radius: 0.6}'"),
    "speed": ("0.2", "surge speed, m/s"),
    "program": ("", "program of stroke and rudder to swim open loop, instead of path and speed"),
    "begin": ("0.0", "s of the program's time"),
    "end": ("0.0", "s of the program's time; 0: its end"),
    "use_sim_time": ("false", "nodes follow /clock"),
}


def _node(spec: NodeSpec, config: str) -> Node:
    parameters: dict[str, object] = {
        "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    }
    if spec == PLANNER:
        parameters["path"] = ParameterValue(LaunchConfiguration("path"), value_type=str)
        parameters["path_args"] = ParameterValue(LaunchConfiguration("path_args"), value_type=str)
        parameters["speed"] = ParameterValue(LaunchConfiguration("speed"), value_type=float)
    if spec == EXCITER:
        parameters["program_file"] = ParameterValue(LaunchConfiguration("program"), value_type=str)
        parameters["begin"] = ParameterValue(LaunchConfiguration("begin"), value_type=float)
        parameters["end"] = ParameterValue(LaunchConfiguration("end"), value_type=float)
    return Node(
        package=spec.package,
        executable=spec.executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[str(parameter_path(spec)), *_own(spec, config), parameters],
        output="screen",
    )


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
    return [_node(spec, config) for spec in specs]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the nodes of the chosen robot."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])
