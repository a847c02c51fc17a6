# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The whole robot: start every node, let the fish swim a path, record, score and show it.

Simulator, camera, tracker and recorder run as processes on their own ROS domain, fusion, planner and controller together as
one more (--separate: each for itself). The command arms the simulated robot itself. The run ends at the end of the path (a
closed one: after a lap), after --duration, or with Ctrl-C; what was recorded is then scored. It ends with an error when the
fish is at a wall of the pool or beyond for 1 s, when the camera is silent for 30 s, and when a node ends or hangs; the
recording is kept.
Times are the simulator's: it runs in real time, and waits for nodes that lag.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from rich.console import Console

from fish_bag import read_trial
from fish_bringup.node_table import (
    CONTROL,
    FAKE,
    HARDWARE,
    LAGS,
    PICTURES,
    PILOT,
    RECORDER,
    SIMULATED,
    VIEW,
    NodeSpec,
    Parameters,
    composed,
    fake_parameters,
    followers,
    robot_of,
)
from fish_bringup.nodes.watch import watching
from fish_bringup.processes import NodeProcesses
from fish_bringup.run_page import cpu_table, latency_table, write_run_page
from fish_bringup.run_watch import Robot, SwimEnd
from fish_bringup.score import error_table, score_trial, what_is_missing
from fish_bringup.view_state import ViewConfig
from fish_control.gains_file import read_gains_file
from fish_control.node_configs import PlannerConfig
from fish_control.paths import make_path, read_arguments
from fish_control.pool import check_inside_pool
from fish_node.domain import choose_domain
from fish_report.errors import Interruption, UserError, user_errors
from fish_report.files import new_folder
from fish_report.page import Table
from fish_report.terminal import print_table, say, terminal
from fish_sim.robot_file import read_model

VIEW_PORT = ViewConfig().port
FULL = 0.75  # share of all cores from which on messages wait for a processor
WAITED = 1.1  # times as long as asked, from which on a run is said to have waited
NEED = 5.0  # cores that the nodes of a fake robot fill in real time
LOCKSTEP = 60.0  # s of real time that simulated time waits for a node
LONGEST = 600.0  # s, a run that does not end by itself
PLANNER, CONTROLLER = CONTROL[2], CONTROL[3]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--letter", default="R", help="letter, or a path family such as circle (R)")
    parser.add_argument(
        "--path-args",
        default="",
        help="of the family, YAML: '{radius: 0.5}', '{file: my.svg, width: 1.4}'",
    )
    parser.add_argument("--speed", type=float, default=0.2, help="surge speed, m/s (0.2)")
    parser.add_argument(
        "--duration",
        type=float,
        default=LONGEST,
        help=f"s, the longest run ({LONGEST:g}); a lap ends a closed path",
    )
    parser.add_argument(
        "--weights", type=Path, help="weights file of the controller (the one it ships with)"
    )
    parser.add_argument(
        "--robot", type=Path, help="robot.yaml or model.yaml that the simulator swims"
    )
    parser.add_argument(
        "--hardware",
        default="sim",
        help=f"{' or '.join(HARDWARE)}: fake swims through the real drivers on emulated devices (sim)",
    )
    parser.add_argument(
        "--lockstep",
        action="store_true",
        help="the simulator waits for every answer of the nodes: the same swim on every computer",
    )
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="never wait: messages are late on a computer that is too slow for real time (simulated time waits for nodes that "
        "lag)",
    )
    parser.add_argument(
        "--real-time-factor",
        type=float,
        help="simulated seconds in a second; every node follows /clock, the drivers of a fake robot too (1, or what this "
        "computer can keep)",
    )
    parser.add_argument(
        "--separate",
        action="store_true",
        help="fusion, planner and controller as processes of their own: half as much processor time again for the three",
    )
    parser.add_argument("--domain", type=int, help="ROS domain, 0 to 232 (a free one)")
    parser.add_argument("--view", action="store_true", help="watch it live in a browser")
    parser.add_argument(
        "--view-port", type=int, default=VIEW_PORT, help=f"of the live view ({VIEW_PORT})"
    )
    parser.add_argument(
        "--out", type=Path, help="new folder for recording, page and logs (out/...)"
    )


def run(args: argparse.Namespace) -> int:
    """Swim, record, score, show."""
    if not args.duration > 0.0:
        raise UserError(f"duration is {args.duration:g} s, expected a positive number")
    specs = robot_of(args.hardware) if args.separate else composed(robot_of(args.hardware))
    if args.lockstep and args.hardware != "sim":
        raise UserError(
            "--lockstep is for the simulator alone: with drivers say --real-time-factor"
        )
    if args.lockstep and args.real_time:
        raise UserError(
            "--lockstep waits for the nodes and --real-time never does: say one of them"
        )
    if args.real_time_factor is None:
        args.real_time_factor = 1.0 if args.real_time else pace(args.hardware)
    if not args.real_time_factor > 0.0:
        raise UserError(
            f"real-time-factor is {args.real_time_factor:g}, expected a positive number"
        )
    with user_errors():
        domain = choose_domain(args.domain)
    start = checked_start(args)
    folder = new_folder(args.out, "demo_" + "".join(c if c.isalnum() else "_" for c in args.letter))
    console = terminal()
    say(
        console,
        f"path {args.letter} at {args.speed:g} m/s, ROS domain {domain}, output in {folder}",
    )
    if args.real_time_factor != 1.0:
        say(console, f"simulated time runs {args.real_time_factor:g} times as fast as real time")
    with tempfile.TemporaryDirectory(prefix="fish_") as devices:
        changed = node_parameters(args, start, folder, Path(devices))
        end, latency = _swim(domain, specs, changed, folder, args.duration, console)
    say(console, f"ended {end.reason}, {end.robot_s:.1f} s after the first odometry")
    trial = read_trial(folder / "recording")
    score = score_trial(trial)
    tables = [error_table(score), latency, cpu_table(end)]
    for table in tables:
        print_table(console, table)
    page = folder / "report.html"
    write_run_page(page, f"Path {args.letter} at {args.speed:g} m/s", trial, score, tables)
    say(console, f"recording: {folder / 'recording'}")
    say(console, f"page: {page}")
    if hint := too_slow(end.cpu.values()) if args.real_time else waited(end, args.real_time_factor):
        say(console, hint)
    if missing := what_is_missing(score):
        raise UserError(missing)
    return 0


def too_slow(shares: Iterable[float], cores: int | None = None) -> str:
    """What to try where the nodes, with these shares of a core, fill most of the computer; empty where they do not."""
    used, all_cores = sum(shares), cores or os.cpu_count() or 1
    if used < FULL * all_cores:
        return ""
    return (
        f"the nodes used {100 * used:.0f} % of a core, this computer has {all_cores}: messages were late, and the errors "
        "are those of a busy computer; without --real-time simulated time waits for the nodes"
    )


def waited(end: SwimEnd, factor: float) -> str:
    """How much longer than asked a run took because simulated time waited for the nodes; empty where it hardly did."""
    if end.seconds <= WAITED * end.robot_s / factor:
        return ""
    return (
        f"{end.robot_s:.0f} s of swimming took {end.seconds:.0f} s: this computer is too slow or too busy for the nodes, and "
        "simulated time waited for them"
    )


def pace(hardware: str, cores: int | None = None) -> float:
    """The real time factor of a run: of a fake robot what a computer with so many cores (this one's) can keep, 1 at most."""
    if hardware != "fake":
        return 1.0
    return min(round(FULL * (cores or os.cpu_count() or 1) / NEED, 2), 1.0)


def node_parameters(
    args: argparse.Namespace, start: Parameters, folder: Path, devices: Path
) -> dict[NodeSpec, dict[str, object]]:
    """What the command line changes in the nodes' parameter files; devices: folder of a fake robot's devices."""
    fake = args.hardware == "fake"
    simulator = FAKE[1] if fake else SIMULATED[0]
    changed: dict[NodeSpec, dict[str, object]] = {
        **(fake_parameters(devices) if fake else {}),
        PLANNER: {"path": args.letter, "path_args": args.path_args, "speed": args.speed},
        RECORDER: {"output": str(folder.resolve()), "name": "recording"},
    }
    changed[simulator] = {**changed.get(simulator, {}), **start}
    if args.lockstep:
        changed[simulator]["lockstep"] = LOCKSTEP
    elif not args.real_time:
        changed[simulator] |= LAGS
    if not (fake or args.real_time):
        changed[simulator] |= PICTURES
    if args.real_time_factor != 1.0:
        changed[simulator]["real_time_factor"] = args.real_time_factor
    if not args.real_time or args.real_time_factor != 1.0:
        for spec in followers(robot_of(args.hardware)):
            changed[spec] = {**changed.get(spec, {}), "use_sim_time": True}
    if args.robot:
        changed[simulator]["robot_file"] = str(args.robot.resolve())
    if args.view:
        changed[VIEW] = {"port": args.view_port}
    if args.weights:
        changed.setdefault(CONTROLLER, {})["weights_file"] = str(args.weights.resolve())
    return changed


def checked_start(args: argparse.Namespace) -> Parameters:
    """The fish waits at the beginning of the path, along it; the nodes will take what they are given.

    Raises:
        UserError: what a node would refuse, seconds after all of them were started.
    """
    with user_errors():
        path = make_path(args.letter, **read_arguments(args.path_args, "path-args"))
        planner = PlannerConfig(path=args.letter, path_args=args.path_args, speed=args.speed)
        check_inside_pool(path, planner.margin)
        if args.weights:
            read_gains_file(args.weights)
    read_model(args.robot)
    (x, y), heading = path.point(0.0), float(path.heading_at(0.0))
    return {"start_x": float(x), "start_y": float(y), "start_heading": heading}


def _swim(
    domain: int,
    specs: Sequence[NodeSpec],
    changed: Mapping[NodeSpec, Parameters],
    folder: Path,
    duration: float,
    console: Console,
) -> tuple[SwimEnd, Table]:
    """Start the nodes, watch the run, end them; the recorder comes before the fish moves and ends first."""
    with Interruption() as interruption, NodeProcesses(domain, folder / "logs") as nodes:
        with watching(domain) as (watch, listen):
            robot = Robot(nodes, watch, listen, interruption)
            last = PILOT if PILOT in specs else CONTROLLER
            for spec in (*specs, *([VIEW] if VIEW in changed else [])):
                if spec != last:
                    nodes.start(spec, changed.get(spec))
            robot.wait_for(lambda: watch.sees(RECORDER.executable), "recorder")
            nodes.start(last, changed if last.parts else changed.get(last))
            robot.wait_for(lambda: watch.tracker is not None, "reference/path")
            robot.wait_for(lambda: watch.sight is not None, "odometry/filtered")
            robot.arm()
            console.print("armed by this command: the robot is simulated, nobody can be hurt")
            _say_view(nodes, changed, console)
            end = robot.swim(duration, console)
            nodes.stop([RECORDER])
            return end, latency_table(watch.diagnostics)


def _say_view(
    nodes: NodeProcesses, changed: Mapping[NodeSpec, Parameters], console: Console
) -> None:
    """Where the live view is, or why there is none: the robot swims all the same."""
    if VIEW not in changed:
        return
    if nodes.running[VIEW].status is None:
        say(console, f"live view: http://127.0.0.1:{changed[VIEW]['port']}/")
    else:
        say(console, f"no live view: {nodes.running[VIEW].last_words()}")
