# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The four drivers of the real robot, for the full ROS 2.

ros2 launch fish_hw drivers.launch.py config:=FOLDER

FOLDER holds this robot's own values: what stands in FOLDER/rotor.yaml, rudder.yaml, ... overrides the installed file of that
name, as in fish.launch.py. The camera usually hangs on another computer than the rest: camera:=false leaves it out.
A driver that ends, ends the launch with it: the unit fish-drivers.service then stops and centres both motors, and starts all
drivers again, disarmed.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

DRIVERS = ("rotor", "rudder", "imu", "camera")
INSTALLED = Path(get_package_share_directory("fish_hw")) / "config"


def _nodes(context: LaunchContext) -> list[Node]:
    config = LaunchConfiguration("config").perform(context)
    files = {name: Path(config).expanduser() / f"{name}.yaml" for name in DRIVERS if config}
    own = {name: [str(file)] for name, file in files.items() if file.exists()}
    if config and not own:
        expected = ", ".join(file.name for file in files.values())
        raise RuntimeError(
            f"config:={config} holds none of the drivers' parameter files; expected some of {expected}"
        )
    return [
        Node(
            package="fish_hw",
            executable=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[str(INSTALLED / f"{name}.yaml"), *own.get(name, [])],
            condition=IfCondition(LaunchConfiguration(name)),
            output="screen",
            on_exit=Shutdown(reason=f"{name} ended"),
        )
        for name in DRIVERS
    ]


def generate_launch_description() -> LaunchDescription:
    """Arguments, then one node per driver."""
    arguments = [
        DeclareLaunchArgument(
            "config",
            default_value="",
            description="folder of parameter files that override the installed",
        ),
        DeclareLaunchArgument(
            "namespace", default_value="fish", description="namespace of all nodes"
        ),
        *(
            DeclareLaunchArgument(name, default_value="true", description=f"start {name}")
            for name in DRIVERS
        ),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])
