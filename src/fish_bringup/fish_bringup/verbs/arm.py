# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arm the robot: rotor and rudder follow commands from then on; --off disarms it at once.

A robot is disarmed when it starts, and again after every trouble: stale commands, a lost camera or IMU, a hot coil, a leak and
others. This command, the service arm, the page of `robofish view --control` and a gamepad arm it, and nothing else. What speaks
against it is printed, and the exit status is then 1.
"""

from __future__ import annotations

import argparse

from fish_bringup.nodes.operator import set_armed
from fish_bringup.robot_arguments import add_robot, check_robot
from fish_report.errors import UserError
from fish_report.printable import plain

TIMEOUT = 5.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--off", action="store_true", help="disarm instead")
    add_robot_and_timeout(parser)


def add_robot_and_timeout(parser: argparse.ArgumentParser) -> None:
    """Which robot is meant, and how long it may take to answer."""
    add_robot(parser)
    parser.add_argument(
        "--timeout", type=float, default=TIMEOUT, help=f"s to wait for the robot ({TIMEOUT:g})"
    )


def run(args: argparse.Namespace) -> int:
    """Ask the robot, and say what it answers."""
    return ask(not args.off, args)


def ask(armed: bool, args: argparse.Namespace) -> int:
    """Arm or disarm the robot of the arguments; UserError if it refuses."""
    check_robot(args)
    done, said = set_armed(armed, args.namespace, args.domain, args.timeout)
    if not done:
        raise UserError(f"not {'armed' if armed else 'disarmed'}: {said}")
    print(plain(said))
    return 0
