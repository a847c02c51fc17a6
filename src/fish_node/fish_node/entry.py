# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the installed executables start: a signal that comes while Python still imports a node ends it with 0 too.

With --help a node says what it is and is not started: a driver would open its device.
"""

import importlib
import signal
import sys
from pathlib import Path
from types import ModuleType

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory


def start(package: str, name: str) -> int | None:
    """Import the node `name` of a package and run it, or say what it is."""
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        node = importlib.import_module(f"{package}.nodes.{name}")
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # from here on the node's own affair
        if {"-h", "--help"} & set(sys.argv[1:]):
            print(_help(package, name, node))
            return 0
        status: int | None = node.main()
    except KeyboardInterrupt:
        return 0
    return status


def _help(package: str, name: str, node: ModuleType) -> str:
    """How the node is started, what it does, and where its parameters stand."""
    try:
        share = Path(get_package_share_directory(package))
    except (PackageNotFoundError, OSError):  # no workspace is sourced: run from the source tree
        share = Path(node.__file__ or "").parents[2]
    what, file = (node.__doc__ or "").partition("\n")[0], share / "config" / f"{name}.yaml"
    given = "--params-file FILE -p NAME:=VALUE ..."
    if parts := getattr(node, "NODES", ()):
        each, file = " ".join(f"--{part} {given}" for part in parts), share / "config" / "NODE.yaml"
        usage = f"usage: {name} --ros-args -r __ns:=/fish {each}"
    else:
        usage = f"usage: {name} [--ros-args -r __ns:=/fish {given}]"
    return f"{usage}\n{what}\nparameters, their units and values: {file}"
