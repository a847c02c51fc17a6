# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Watch the robot in a browser: pool, path, fish, errors, gains, health, arming state; Foxglove gets every topic.

It only shows, unless --control is given: then the page's buttons arm and disarm. It is served on this computer only, unless
--address says otherwise: whoever reaches the page of a view with --control can stop the robot, and arm it. Ctrl-C ends it.
"""

from __future__ import annotations

import argparse
import os

from fish_bringup.node_table import VIEW, command, middleware
from fish_bringup.robot_arguments import add_robot, check_robot
from fish_bringup.view_state import ViewConfig
from fish_report.errors import user_errors


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    usual = ViewConfig()
    parser.add_argument("--port", type=int, default=usual.port, help=f"of the page ({usual.port})")
    parser.add_argument(
        "--foxglove-port",
        type=int,
        default=usual.foxglove_port,
        help=f"of the websocket for Foxglove, 0 for none ({usual.foxglove_port})",
    )
    parser.add_argument(
        "--address",
        default=usual.address,
        help=f"to serve it on; 0.0.0.0 for other computers ({usual.address})",
    )
    parser.add_argument("--control", action="store_true", help="let the page arm and disarm")
    add_robot(parser)


def run(args: argparse.Namespace) -> int:
    """Become the node live_view."""
    with user_errors():
        config = ViewConfig(args.address, args.port, args.foxglove_port, args.control)
    check_robot(args)
    names = ("address", "port", "foxglove_port", "control")
    line = command(VIEW, {name: getattr(config, name) for name in names}, args.namespace)
    env = {**os.environ, **middleware(), "PYTHONUNBUFFERED": "1"}
    if args.domain is not None:
        env["ROS_DOMAIN_ID"] = str(args.domain)
    os.execve(line[0], line, env)
