"""Where the installed executables start: a signal that comes while Python still imports a node ends it with 0 too."""

import importlib
import signal


def _start(name: str) -> int | None:
    """Import a node and run it."""
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        node = importlib.import_module(f"fish_control.nodes.{name}")
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # from here on the node's own affair
        status: int | None = node.main()
    except KeyboardInterrupt:
        return 0
    return status


def fusion() -> int | None:
    """Entry point."""
    return _start("fusion")


def planner() -> int | None:
    """Entry point."""
    return _start("planner")


def controller() -> int | None:
    """Entry point."""
    return _start("controller")


def exciter() -> int | None:
    """Entry point."""
    return _start("exciter")
