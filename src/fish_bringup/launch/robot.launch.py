# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The real robot on one computer: `ros2 launch fish_bringup robot.launch.py config:=myfish path:=R`.

It is disarmed at its start: `robofish arm` lets it swim.
"""

from launch import LaunchDescription

from fish_bringup.nodes.launch_robot import describe


def generate_launch_description() -> LaunchDescription:
    """Arguments (--show-args), then the nodes."""
    return describe(robot="real", part="all")
