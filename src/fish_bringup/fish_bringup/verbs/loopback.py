# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Print the shell lines that keep messages on this computer: eval "$(robofish loopback)" before nodes are started by hand.

Fast DDS then opens no port towards the network, and shared memory is off. `demo`, `excite` and `view` do the same by
themselves, launch files with local:=true. Nodes on two computers need the network: start those without it.
"""

from __future__ import annotations

import argparse
import shlex

from fish_bringup.node_table import middleware


def add_arguments(_: argparse.ArgumentParser) -> None:
    """There are none."""


def run(_: argparse.Namespace) -> int:
    """Print one export for each variable."""
    for name, value in middleware().items():
        print(f"export {name}={shlex.quote(value)}")
    return 0
