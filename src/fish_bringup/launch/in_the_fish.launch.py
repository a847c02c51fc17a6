# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The computer in the fish, of two: drivers of rotor, rudder and IMU.

`ros2 launch fish_bringup in_the_fish.launch.py config:=myfish`.
"""

from launch import LaunchDescription

from fish_bringup.nodes.launch_robot import describe


def generate_launch_description() -> LaunchDescription:
    """Arguments (--show-args), then the nodes."""
    return describe(robot="real", part="fish", record="false", view="false", local="false")
