# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arguments that say which running robot a verb means: namespace and ROS domain."""

from __future__ import annotations

import argparse
import re

from fish_bringup.node_table import NAMESPACE
from fish_node.domain import LAST_DOMAIN
from fish_report.errors import UserError

NAME = re.compile(
    r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII
)  # of ROS 2, relative or from the root


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Declare --namespace and --domain."""
    parser.add_argument("--namespace", default=NAMESPACE, help=f"of the robot ({NAMESPACE})")
    parser.add_argument("--domain", type=int, help="ROS domain (ROS_DOMAIN_ID)")


def check_robot(args: argparse.Namespace) -> None:
    """Raise UserError if no robot can have this namespace and domain."""
    if args.domain is not None and not 0 <= args.domain <= LAST_DOMAIN:
        raise UserError(f"domain is {args.domain}, expected 0 to {LAST_DOMAIN}")
    if not NAME.fullmatch(args.namespace) or "__" in args.namespace:
        raise UserError(
            f"namespace is {args.namespace!r}, expected words of letters, digits and single _ between /, such as {NAMESPACE}"
        )
