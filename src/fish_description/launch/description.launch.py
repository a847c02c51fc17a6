# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fish for rviz: robot_state_publisher, joint_angles and, on demand, rviz itself.

ros2 launch fish_description description.launch.py rviz:=true

It shows a robot that swims already (fish.launch.py) or a recording that is replayed, and commands nothing.
"""

import shlex
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "namespace": ("fish", "namespace of the robot's nodes"),
    "robot": ("", "robot.yaml with the lengths to draw; empty: the nominal fish"),
    "tail_links": ("3", "links of the tail to draw; as many as the tracker finds"),
    "frame_prefix": ("", "before every frame's name, such as fish_2/ for a second robot"),
    "use_sim_time": ("false", "true: follow /clock"),
    "rviz": ("false", "true: start rviz with the layout of this package"),
}


def _nodes(context: LaunchContext) -> list[Node]:
    share = Path(get_package_share_directory("fish_description"))
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    robot = f"robot:={Path(given['robot']).expanduser().resolve()}" if given["robot"] else ""
    words = ["xacro", str(share / "urdf" / "fish.urdf.xacro"), f"tail_links:={given['tail_links']}"]
    urdf = Command(shlex.join([*words, robot] if robot else words))
    time = {"use_sim_time": ParameterValue(given["use_sim_time"], value_type=bool)}
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=given["namespace"],
            parameters=[
                time,
                {
                    "robot_description": ParameterValue(urdf, value_type=str),
                    "frame_prefix": given["frame_prefix"],
                },
            ],
            remappings=[("joint_states", "description/joint_states")],
            output="screen",
        ),
        Node(
            package="fish_description",
            executable="joint_angles",
            namespace=given["namespace"],
            parameters=[
                str(share / "config" / "joint_angles.yaml"),
                time,
                {"tail_links": ParameterValue(given["tail_links"], value_type=int)},
            ],
            output="screen",
        ),
        Node(
            package="rviz2",
            executable="rviz2",
            namespace=given["namespace"],
            arguments=["--display-config", str(share / "rviz" / "fish.rviz")],
            parameters=[time],
            condition=IfCondition(given["rviz"]),
            output="screen",
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then the nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])
