# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulated robot: `ros2 launch fish_bringup simulation.launch.py path:=S view:=true`."""

from launch import LaunchDescription

from fish_bringup.nodes.launch_robot import describe


def generate_launch_description() -> LaunchDescription:
    """Arguments (--show-args), then the nodes."""
    return describe(robot="sim", part="all")
