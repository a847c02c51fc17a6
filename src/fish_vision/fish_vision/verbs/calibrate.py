# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Set up the overhead camera: its lens, its mount, the markers' colours, tags to print.

calibrate lens: camera matrix and distortion from chessboard pictures. calibrate mount: position and tilt from known
points of the pool. calibrate colours: colour ranges from pictures of the fish in today's light. calibrate tags: a sheet of
coded tags to print.
"""

import argparse

from fish_report.errors import UserError
from fish_vision.calibration import CalibrationError
from fish_vision.commands.calibrate import add_verbs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_verbs(parser)


def run(args: argparse.Namespace) -> int:
    try:
        args.calibrate(args)
    except CalibrationError as error:
        raise UserError(str(error)) from error
    return 0
