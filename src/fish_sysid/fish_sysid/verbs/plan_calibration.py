# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plan the shortest set of swims that determines a robot's parameters to wanted errors, before anybody swims.

The model itself tells what each of several hundred swims would say of its parameters, with the robot's sensors and the filter
of `identify`; the errors are those that `identify` will state, for the given robot and for others within its priors. A
parameter's prior is that of its `knowledge` in robot.yaml. The plan is a JSON file: `robofish excite PLAN` swims it, `--plan`
shows where the fish is put. A model that lacks something is not determined by a plan: `robofish diagnose` looks for that.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fish_report.errors import UserError, user_errors
from fish_report.files import writable_file
from fish_report.terminal import print_table, terminal
from fish_sim.robot_file import read_model

if TYPE_CHECKING:
    from fish_sysid.design.sensitivity import SensorSet


ERROR = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument("--robot", type=Path, help="robot.yaml (default: the nominal robot)")
    parser.add_argument(
        "--error",
        type=float,
        default=ERROR,
        help="standard error wanted of every parameter, as a share of it (default: %(default)s)",
    )
    parser.add_argument(
        "--errors",
        default="",
        metavar="NAME=SHARE,...",
        help="other errors of single parameters",
    )
    add_sensor_arguments(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("calibration.json"), help="file (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Plan, print, write."""
    from fish_sysid.design.calibration_plan import plan_calibration, write_plan
    from fish_sysid.reports.design_tables import error_table, swim_table

    console = terminal()
    with user_errors():
        writable_file(args.out, inputs=(args.robot,))
        plan = plan_calibration(
            read_model(args.robot),
            sensor_set(args),
            error=args.error,
            errors=single_errors(args.errors),
            report=lambda text: console.print(text, style="dim", highlight=False),
        )
    write_plan(args.out, plan)
    print_table(console, swim_table(plan))
    print_table(console, error_table(plan))
    console.print(
        f"{len(plan.swims)} swims of {plan.seconds:.0f} s together in {args.out}; next: robofish excite {args.out}",
        highlight=False,
        soft_wrap=True,
    )
    return 0


def single_errors(text: str) -> dict[str, float]:
    """The table in NAME=SHARE,NAME=SHARE."""
    found = {}
    for part in filter(None, text.split(",")):
        name, _, share = part.partition("=")
        try:
            found[name] = float(share)
        except ValueError:
            raise UserError(
                f"--errors: got {part!r}; expected NAME=SHARE, for example head_inertia=0.02"
            ) from None
    return found


def add_sensor_arguments(parser: argparse.ArgumentParser) -> None:
    """Rates of camera, IMU and encoder."""
    for name, rate in (("camera", 30.0), ("imu", 100.0), ("encoder", 100.0)):
        none = "" if name == "camera" else "; 0: none"
        parser.add_argument(
            f"--{name}-rate",
            type=float,
            default=rate,
            metavar="HZ",
            help=f"samples of the {name} per second{none} (default: %(default)s)",
        )


def sensor_set(args: argparse.Namespace) -> SensorSet:
    """The sensors that the arguments describe."""
    from fish_sysid.design.sensitivity import SensorSet

    return SensorSet(args.camera_rate, args.imu_rate, args.encoder_rate)
