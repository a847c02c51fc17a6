# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The computer at the pool, of two: camera, tracker, fusion, planner, controller, recorder, and the live view with view:=true."""

from launch import LaunchDescription

from fish_bringup.nodes.launch_robot import describe


def generate_launch_description() -> LaunchDescription:
    """Arguments (--show-args), then the nodes."""
    return describe(robot="real", part="shore", local="false")
