# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drive rotor and rudder by hand, from the keyboard or a gamepad, for as long as a deadman is held.

Keyboard: the arrow keys change throttle and rudder; keep pressing them: after --timeout without a key the rotor stops and the
rudder goes to the centre, as with any other key; q ends. Gamepad (topic joy, node joy_node of the full ROS): hold the button
--deadman. Planner and controller must not run meanwhile. The robot must be armed: by `robofish arm`, or by the button --arm
while --deadman is held and the throttle is at rest; the button --stop disarms it. operator/deadman is true while the deadman
is held; a robot with deadman_timeout_s is disarmed when it is released.
"""

from __future__ import annotations

import argparse
import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, fields

from fish_bringup.nodes.operator import HandDrive, Pad, driving
from fish_bringup.robot_arguments import add_robot, check_robot
from fish_control.manual_drive import ManualDrive
from fish_report.errors import Interruption, UserError, user_errors
from fish_report.terminal import say, terminal

TIMEOUT = 1.0  # s; a terminal repeats a key after half a second
DISCOVERY = 1.0  # s, until other publishers are known
LOOK = 0.02  # s between looks at the keyboard
AXES = ("throttle", "rudder")  # of the gamepad; the rest of Pad are buttons


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--timeout", type=float, default=TIMEOUT, help=f"s without a word until rest ({TIMEOUT:g})"
    )
    for field in fields(Pad):
        kind = "axis" if field.name in AXES else "button"
        parser.add_argument(
            f"--{field.name}",
            type=int,
            default=field.default,
            help=f"{kind} of the gamepad ({field.default})",
        )
    add_robot(parser)


def run(args: argparse.Namespace) -> int:
    """Drive until q or Ctrl-C."""
    check_robot(args)
    pad = Pad(**{field.name: getattr(args, field.name) for field in fields(Pad)})
    if min(astuple(pad)) < 0:
        raise UserError("buttons and axes are counted from 0")
    if len({pad.deadman, pad.arm, pad.stop}) < 3:
        raise UserError("--deadman, --arm and --stop must be three buttons")
    with user_errors():
        drive = ManualDrive(args.timeout)
    with (
        Interruption() as interruption,
        keyboard() as keys,
        driving(args.domain, args.namespace, drive, pad) as (node, spin),
    ):
        spin(DISCOVERY)
        if node.rivals > 0:
            raise UserError(
                "another node publishes joint_command: stop controller or exciter before you drive by hand"
            )
        ways = "arrow keys, any other key is rest, q ends" if keys else "no keyboard here, only joy"
        say(terminal(), f"driving {args.namespace} by hand: {ways}")
        said = ""
        while not interruption.asked and _heed(keys, drive):
            spin(LOOK)
            if (now := _armed(node)) != said:
                said = now
                say(terminal(), said)
    return 0


def _heed(keys: Keyboard | None, drive: ManualDrive) -> bool:
    """Take a key; False if it ends the drive."""
    key = keys.key() if keys else None
    if key == "q":
        return False
    if key is not None and drive.press(key):
        drive.hold(time.monotonic())
    return True


def _armed(node: HandDrive) -> str:
    """What the robot says of its arming state."""
    if node.arming.armed is None:
        return "nothing heard of the robot's arming state yet"
    if node.arming.armed:
        return "armed"
    refused = f"; {node.answer}" if node.answer.startswith("not") else ""
    return f"disarmed ({node.arming.reason}); robofish arm or the arm button arms it{refused}"


ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}
ARROW = re.compile(rb"\x1b\[[A-D]")


class Keyboard:
    """Reads a terminal by its file descriptor."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal

    def key(self) -> str | None:
        """`up`, `down`, `left`, `right`, or the character; None if no key was pressed.

        Of several keys q comes first, then one that is no arrow, then the last arrow.
        """
        if not select.select([self._terminal], [], [], 0.0)[0]:
            return None
        pressed = os.read(self._terminal, 4096)  # as much as a terminal keeps
        arrows, others = ARROW.findall(pressed), ARROW.sub(b"", pressed)
        if arrows and not others:
            return ARROWS[arrows[-1]]
        return "q" if b"q" in others else others[-1:].decode("latin-1")


@contextmanager
def keyboard() -> Iterator[Keyboard | None]:
    """The terminal of standard input, single keys; None where it is no terminal.

    Raises:
        UserError: the terminal cannot be set.
    """
    if not sys.stdin.isatty():
        yield None
        return
    terminal = sys.stdin.fileno()
    try:
        before = termios.tcgetattr(terminal)
        tty.setcbreak(terminal)
    except termios.error as error:
        raise UserError(f"the terminal gives no single keys: {error}") from error
    try:
        yield Keyboard(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
