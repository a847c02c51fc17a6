# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Disarm the robot: the rotor ramps down and coasts, the rudder goes to its centre, until it is armed again."""

from __future__ import annotations

import argparse

from fish_bringup.verbs.arm import add_robot_and_timeout, ask


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add_robot_and_timeout(parser)


def run(args: argparse.Namespace) -> int:
    """Ask the robot, and say what it answers."""
    return ask(False, args)
