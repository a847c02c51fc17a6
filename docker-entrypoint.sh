#!/bin/bash
# Sources ROS 2, the virtual environment and the workspace, then runs the command.
set -e
source /opt/ros/jazzy/setup.bash
source /robot_fish/.venv/bin/activate
source /robot_fish/install/setup.bash
exec "$@"
