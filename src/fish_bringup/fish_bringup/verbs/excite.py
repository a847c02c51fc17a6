# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swim a program of stroke and rudder open loop and record it: the next experiment of a diagnosis, or your own.

The program is a diagnosis.json, or rows {t: s, amplitude: rad, frequency: Hz, rudder: rad} in JSON or YAML. It is cut into
swims that the pool has room for, each recorded from rest; the folder of recordings is ready for identify and diagnose.
A swim ends with an error when the fish leaves the pool, when the camera is silent for 30 s, or when it lasts 10 s longer
than its part of the program, all by the simulator's clock. Every recording is checked: what it lacks is said, and the exit
status is then 1.
The command arms the simulated robot itself. On the real robot a person does (robofish arm), and the same
program runs with `ros2 launch fish_bringup fish.launch.py robot:=real program:=FILE begin:=S
end:=S`, swim after swim as --plan lists them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from rich.console import Console

from fish_bag import read_trial
from fish_bringup.excite_check import incomplete
from fish_bringup.node_table import (
    EXCITER,
    PICTURES,
    RECORDER,
    ROBOTS,
    SIMULATED,
    NodeSpec,
    followers,
    open_loop,
)
from fish_bringup.nodes.watch import watching
from fish_bringup.processes import NodeProcesses
from fish_bringup.run_watch import (
    LOOK_PERIOD,
    Patience,
    RunWatch,
    check_running,
    end_if_due,
)
from fish_bringup.run_watch import Robot as Running
from fish_control.excitation import LAST_ROW, Program, read_program
from fish_control.excursions import (
    COAST,
    SHORTEST,
    Excursion,
    excursions,
    next_begin,
    next_excursion,
)
from fish_node.domain import choose_domain
from fish_report.errors import Interruption, UserError, user_errors
from fish_report.files import new_folder
from fish_report.page import Table
from fish_report.terminal import cell, print_table, say, terminal
from fish_sim.robot import Robot
from fish_sim.robot_file import read_model
from fish_sim.way import way_from_rest

SIMULATOR, CAMERA = SIMULATED
EXCITER_NAME = "fish/exciter"
PATIENCE = 60.0  # s of real time that simulated time waits for a node; the run waits less for simulated time
SLACK = 10.0  # s of the robot's time that a swim may last longer than its part of the program


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "program",
        type=Path,
        help=f"diagnosis.json, or a JSON or YAML file of rows; the last row lasts {LAST_ROW:g} s",
    )
    parser.add_argument(
        "--robot", type=Path, help="robot.yaml or model.yaml that the simulator swims"
    )
    parser.add_argument(
        "--begin", type=float, default=0.0, help="s of the program's time to begin at (0)"
    )
    parser.add_argument(
        "--plan", action="store_true", help="only list the swims and where the fish is put"
    )
    parser.add_argument("--domain", type=int, help="ROS domain, 0 to 232 (a free one)")
    parser.add_argument("--out", type=Path, help="new folder for recordings and logs (out/...)")


def run(args: argparse.Namespace) -> int:
    """List the swims, or swim and record them."""
    robot = read_model(args.robot)
    with user_errors():
        program = read_program(args.program)
        if not 0.0 <= args.begin <= program.duration - SHORTEST:
            raise UserError(
                f"begin is {args.begin:g} s, expected 0 to {program.duration - SHORTEST:g} s: the program lasts "
                f"{program.duration:g} s ({LAST_ROW:g} s from its last row on), a swim at least {SHORTEST:g} s"
            )
        if args.plan:
            print_table(
                terminal(),
                plan_table(excursions(program, partial(way_from_rest, robot), args.begin)),
            )
            return 0
        folder = new_folder(args.out, "excite")
        domain = choose_domain(args.domain)
        console = terminal()
        say(console, f"program of {program.duration:g} s, ROS domain {domain}, output in {folder}")
        say(console, "this command arms the robot for every swim: it is simulated")
        count, lacking = _swim_all(program, robot, args, domain, folder, console)
    recordings = folder / "recordings"
    if lacking:
        raise UserError(
            f"{', '.join(lacking)} of {count} recordings in {recordings} lack what the lines above say: swim them again, or "
            "leave them out"
        )
    say(
        console,
        f"{count} recordings in {recordings}; next: robofish diagnose {recordings} --out {folder / 'diagnosis'}",
    )
    return 0


def plan_table(swims: Iterable[Excursion]) -> Table:
    """Which part of the program each swim is, and where the fish is put, at rest."""
    rows = [
        [
            f"{k}",
            f"{s.begin:.1f}",
            f"{s.end:.1f}",
            f"{s.x:+.2f}",
            f"{s.y:+.2f}",
            f"{s.heading:+.2f}",
        ]
        for k, s in enumerate(swims)
    ]
    return Table("Swims", ["swim", "begin, s", "end, s", "x, m", "y, m", "heading, rad"], rows)


def _swim_all(
    program: Program,
    robot: Robot,
    args: argparse.Namespace,
    domain: int,
    folder: Path,
    console: Console,
) -> tuple[int, list[str]]:
    """Swim after swim until the program is through or Ctrl-C; how many were recorded, and which of them lack something."""
    begin, count, lacking = args.begin, 0, []
    with Interruption() as interruption:
        while program.duration - begin >= SHORTEST and not interruption.asked:
            swim = next_excursion(program, begin, partial(way_from_rest, robot))
            name = f"trial_{count:02d}"
            changed = parameters(args, swim, folder, name)
            reached, said = _swim(
                domain, changed, swim, folder / "logs" / name, interruption, console
            )
            lacks = incomplete(read_trial(folder / "recordings" / name), program, begin, reached)
            if lacks:
                lacking.append(name)
                said = f"incomplete: {'; '.join(lacks)}"
            say(
                console, f"{name}: {begin:.1f} to {reached:.1f} s of {program.duration:g} s; {said}"
            )
            count += 1
            if reached - begin < 1.0 and not interruption.asked:
                raise UserError(
                    f"the fish came no further than {reached:.1f} s; see the logs in {folder / 'logs'}"
                )
            begin = next_begin(program, reached)
    return count, lacking


def parameters(
    args: argparse.Namespace, swim: Excursion, folder: Path, name: str
) -> dict[NodeSpec, dict[str, object]]:
    """What one swim changes in the nodes' parameter files.

    All follow the simulator's clock, which waits for them: a command acts from its stamp on, however busy the computer is. With
    clocks of their own it acts at the simulator's next step, which in a recording is a late rudder.
    """
    start: dict[str, object] = {"start_x": swim.x, "start_y": swim.y, "start_heading": swim.heading}
    if args.robot:
        start["robot_file"] = str(args.robot.resolve())
    changed: dict[NodeSpec, dict[str, object]] = {
        SIMULATOR: {**start, "lockstep": PATIENCE, **PICTURES},
        EXCITER: {
            "program_file": str(args.program.resolve()),
            "begin": swim.begin,
            "end": swim.end,
        },
        RECORDER: {"output": str((folder / "recordings").resolve()), "name": name},
    }
    for spec in followers(open_loop(ROBOTS["sim"])):
        changed[spec] = {"use_sim_time": True, **changed.get(spec, {})}
    return changed


def _swim(
    domain: int,
    changed: dict[NodeSpec, dict[str, object]],
    swim: Excursion,
    logs: Path,
    interruption: Interruption,
    console: Console,
) -> tuple[float, str]:
    """Record one swim; the program's time that it reached, and how it ended.

    Raises:
        UserError: the fish left the pool, camera or exciter are silent, a node ended or hangs.
    """
    with NodeProcesses(domain, logs) as nodes, watching(domain) as (watch, listen):
        running = Running(nodes, watch, listen, interruption)
        for spec in open_loop(ROBOTS["sim"]):
            if spec != EXCITER:
                nodes.start(spec, changed.get(spec))
        running.wait_for(lambda: watch.sees(RECORDER.executable), "recorder")
        running.wait_for(lambda: watch.sight is not None, "odometry/filtered")
        nodes.start(EXCITER, changed[EXCITER])
        running.wait_for(lambda: EXCITER_NAME in watch.diagnostics, "exciter")
        running.arm()
        patience, at = Patience(nodes), watch.sight
        run_watch = RunWatch(0.0 if at is None else at.stamp, swim.end - swim.begin + SLACK)
        with console.status("") as line:
            while watch.diagnostics[EXCITER_NAME]["over"] != "true" and not interruption.asked:
                listen(LOOK_PERIOD)
                check_running(nodes)
                at = watch.sight
                patience.heed(at)
                if at is not None:
                    end_if_due(run_watch, at.stamp, watch.seen)
                where = f"x {at.x:+.2f} m  y {at.y:+.2f} m   speed {at.speed:.2f} m/s" if at else ""
                time_s = watch.diagnostics[EXCITER_NAME]["time_s"]
                line.update(cell(f"{time_s} s of the program   {where}"))
            listen(COAST)
        nodes.stop([EXCITER])
        nodes.stop([RECORDER])
        return float(watch.diagnostics[EXCITER_NAME]["time_s"]), watch.levels[EXCITER_NAME][1]
