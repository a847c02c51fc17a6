"""One run of the started robot, watched until it ends: progress, end of path or time, nodes that fail."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from rich.console import Console
from rich.status import Status

from fish_control.path_tracker import PathTracker

from .bringup import NodeSpec
from .errors import UserError
from .processes import NodeProcess, NodeProcesses

START_TIMEOUT = 30.0  # s in which each thing that is waited for must come
LOOK_PERIOD = 0.1  # s between looks at the robot
LAST_LOOK = 0.5  # s after the end of the path: the estimate may be there a little before the fish


class Sight(Protocol):
    """Where the robot believes to be."""

    stamp: float
    x: float
    y: float
    heading: float
    speed: float


class Watch(Protocol):
    """What the watching node has heard last."""

    sight: Sight | None
    tracker: PathTracker | None


@dataclass(frozen=True)
class SwimEnd:
    """How a run ended, and what it cost.

    Attributes:
        seconds: wall time from the first odometry to the end.
        cpu: share of one core each node used meanwhile.
    """

    reason: str
    seconds: float
    cpu: dict[NodeSpec, float]


def wait_for(
    there: Callable[[], bool], what: str, nodes: NodeProcesses, listen: Callable[[float], None]
) -> None:
    """Listen until something is there.

    Raises:
        UserError: a node ended, or it did not come in time.
    """
    deadline = time.monotonic() + START_TIMEOUT
    while not there():
        listen(LOOK_PERIOD)
        check_running(nodes)
        if time.monotonic() > deadline:
            raise UserError(f"no {what} within {START_TIMEOUT:.0f} s of the start; see the logs of the nodes")


def swim(
    nodes: NodeProcesses, watch: Watch, listen: Callable[[float], None], duration: float, console: Console
) -> SwimEnd:
    """Watch the robot for at most `duration` seconds of its own time, with a line of progress."""
    begin, cpu_before = time.monotonic(), nodes.cpu_times()
    with console.status("") as line:
        try:
            reason = _follow(nodes, watch, listen, duration, line)
        except KeyboardInterrupt:
            reason = "as interrupted"
    seconds = time.monotonic() - begin
    used = {spec: spent - cpu_before[spec] for spec, spent in nodes.cpu_times().items()}
    return SwimEnd(reason, seconds, {spec: cpu_s / seconds for spec, cpu_s in used.items()})


def _follow(
    nodes: NodeProcesses, watch: Watch, listen: Callable[[float], None], duration: float, line: Status
) -> str:
    """Until the end of the path, one lap of a closed one, or the end of the time; the reason."""
    first, path, lap_start = watch.sight.stamp, watch.tracker.path, watch.tracker.progress
    while (t := watch.sight.stamp - first) < duration:
        listen(LOOK_PERIOD)
        check_running(nodes)
        sight = watch.sight
        on_path = watch.tracker.update((sight.x, sight.y))
        line.update(
            f"{t:6.1f} s   x {sight.x:+.2f} m  y {sight.y:+.2f} m   "
            f"cross-track {1000 * on_path.cross_track_error:+4.0f} mm   speed {sight.speed:.2f} m/s   "
            f"{on_path.progress:.2f} of {path.length:.2f} m"
        )
        if on_path.finished:
            listen(LAST_LOOK)
            return "at the end of the path"
        if path.closed and on_path.progress - lap_start >= path.length:
            return "after one lap"
    return f"after {duration:.0f} s"


def check_running(nodes: NodeProcesses) -> None:
    """Raise UserError with a node's last words if one has ended."""
    for process in nodes.ended():
        raise UserError(_obituary(process))


def _obituary(process: NodeProcess) -> str:
    return (
        f"{process.spec.name} ended with status {process.status}: {process.last_words()} (log: {process.log})"
    )
