# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The whole robot with the full ROS 2: `ros2 launch fish_bringup fish.launch.py robot:=sim path:=R speed:=0.2`.

The same nodes with the same parameter files as the pip-only starter (fish_bringup.node_table); robot:=real takes
the drivers of fish_hw in place of simulator and simulated camera, and robot:=fake lets these drivers swim emulated devices with
the simulator behind them. config:=FOLDER holds this robot's own values: what stands
in FOLDER/rotor.yaml, tracker.yaml, ... overrides the installed file of that name, and an argument that is given here overrides
both. program:=diagnosis.json swims the proposed experiment open loop: the exciter takes the place of planner and controller.
"""

from launch import LaunchDescription

from fish_bringup.nodes.launch_robot import describe


def generate_launch_description() -> LaunchDescription:
    """Arguments (--show-args), then the nodes."""
    return describe()
