"""The whole robot with the full ROS 2: `ros2 launch fish_train fish.launch.py robot:=sim path:=R speed:=0.2`.

The same nodes with the same parameter files as the pip-only starter (fish_train.bringup); robot:=real takes
the drivers of fish_hw in place of simulator and simulated camera.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from fish_train.bringup import CONTROL, NAMESPACE, ROBOTS, NodeSpec, parameter_path

PLANNER = CONTROL[2]
ARGUMENTS = {
    "robot": ("sim", "sim or real"),
    "namespace": (NAMESPACE, "namespace of all nodes"),
    "path": ("R", "letter or path family"),
    "speed": ("0.2", "surge speed, m/s"),
    "use_sim_time": ("false", "nodes follow /clock"),
}


def _node(spec: NodeSpec) -> Node:
    parameters: dict[str, object] = {
        "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    }
    if spec == PLANNER:
        parameters["path"] = ParameterValue(LaunchConfiguration("path"), value_type=str)
        parameters["speed"] = ParameterValue(LaunchConfiguration("speed"), value_type=float)
    return Node(
        package=spec.package,
        executable=spec.executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[str(parameter_path(spec)), parameters],
        output="screen",
    )


def _nodes(context: LaunchContext) -> list[Node]:
    robot = LaunchConfiguration("robot").perform(context)
    if robot not in ROBOTS:
        raise RuntimeError(f"robot:={robot} is unknown; known: {', '.join(ROBOTS)}")
    return [_node(spec) for spec in ROBOTS[robot]]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the nodes of the chosen robot."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])
