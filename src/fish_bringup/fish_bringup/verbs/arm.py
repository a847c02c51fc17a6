# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arm the robot: rotor and rudder follow commands from then on; --off disarms it at once.

A robot is disarmed when it starts, and again after every trouble: stale commands, a lost camera or IMU, a hot coil, a leak and
others. Only this command, the service arm and the operator's panel arm it. What speaks against it is printed, and the exit
status is then 1.
"""

from __future__ import annotations

import argparse

from fish_bringup.node_table import NAMESPACE
from fish_bringup.nodes.operator import set_armed
from fish_report.errors import UserError
from fish_report.printable import plain

TIMEOUT = 5.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--off", action="store_true", help="disarm instead")
    add_robot(parser)


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Which robot is meant."""
    parser.add_argument("--namespace", default=NAMESPACE, help=f"of the robot ({NAMESPACE})")
    parser.add_argument("--domain", type=int, help="ROS domain (ROS_DOMAIN_ID)")
    parser.add_argument(
        "--timeout", type=float, default=TIMEOUT, help=f"s to wait for the robot ({TIMEOUT:g})"
    )


def run(args: argparse.Namespace) -> int:
    """Ask the robot, and say what it answers."""
    return ask(not args.off, args)


def ask(armed: bool, args: argparse.Namespace) -> int:
    """Arm or disarm the robot of the arguments; UserError if it refuses."""
    if args.domain is not None and not 0 <= args.domain <= 232:
        raise UserError(f"domain is {args.domain}, expected 0 to 232")
    done, said = set_armed(armed, args.namespace, args.domain, args.timeout)
    if not done:
        raise UserError(f"not armed: {said}")
    print(plain(said))
    return 0
