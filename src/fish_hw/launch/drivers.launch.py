"""The four drivers of the real robot, for the full ROS 2.

ros2 launch fish_hw drivers.launch.py config:=FOLDER

The camera usually hangs on another computer than the rest: camera:=false leaves it out.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node

DRIVERS = ("rotor", "rudder", "imu", "camera")


def generate_launch_description() -> LaunchDescription:
    """One node per driver; each parameter file is FOLDER/<node>.yaml."""
    folder = str(Path(get_package_share_directory("fish_hw")) / "config")
    arguments = [
        DeclareLaunchArgument("config", default_value=folder, description="folder of the parameter files"),
        DeclareLaunchArgument("namespace", default_value="fish", description="namespace of all nodes"),
        *(DeclareLaunchArgument(name, default_value="true", description=f"start {name}") for name in DRIVERS),
    ]
    nodes = [
        Node(
            package="fish_hw",
            executable=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[PathJoinSubstitution([LaunchConfiguration("config"), f"{name}.yaml"])],
            condition=IfCondition(LaunchConfiguration(name)),
            output="screen",
        )
        for name in DRIVERS
    ]
    return LaunchDescription(arguments + nodes)
