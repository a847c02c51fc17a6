# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Set up the overhead camera: its lens, its mount, the markers' colours, tags to print.

calibrate lens: camera matrix and distortion from chessboard pictures. calibrate mount: position and tilt from known
points of the pool. calibrate colours: colour ranges from pictures of the fish in today's light. calibrate tags: a sheet of
coded tags to print.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from fish_report.errors import UserError
from fish_vision.calibration import CalibrationError
from fish_vision.tags import PAGES, tag_sheet
from fish_vision.verbs import calibrate_colours, calibrate_lens, calibrate_mount
from fish_vision.verbs.pictures import new_file

DESCRIPTION = "calibrate lens | mount | colours | tags: make the files that tell the tracker about its camera and its light."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_verbs(parser)


def run(args: argparse.Namespace) -> int:
    try:
        args.calibrate(args)
    except CalibrationError as error:
        raise UserError(str(error)) from error
    return 0


def add_verbs(parser: argparse.ArgumentParser) -> None:
    """Sub-commands of calibrate; each sets `calibrate`, the function to call."""
    verbs = parser.add_subparsers(required=True)
    for command in (calibrate_lens, calibrate_mount, calibrate_colours):
        command.add_parser(verbs)
    _add_tags_parser(verbs)


def _add_tags_parser(verbs: Any) -> None:
    tags = verbs.add_parser("tags", help="a sheet of coded tags to print, in true millimetres")
    tags.add_argument("numbers", nargs="+", type=int, help="of the tags, such as 0 1 2 3")
    tags.add_argument("--side", type=float, default=50.0, help="of the black square, mm (50)")
    tags.add_argument("--dictionary", default="4X4_50", help="of the tags (4X4_50)")
    tags.add_argument("--page", choices=PAGES, default="A4", help="(A4)")
    tags.add_argument("--out", type=Path, default=Path("tags.svg"), help="the sheet (tags.svg)")
    tags.set_defaults(calibrate=calibrate_tags)


def calibrate_tags(args: argparse.Namespace) -> None:
    """Write the sheet."""
    out = new_file(args.out)
    try:
        sheet = tag_sheet(args.dictionary, args.numbers, args.side, PAGES[args.page])
    except ValueError as error:
        raise CalibrationError(str(error)) from error
    out.write_text(sheet)
    print(
        f"{out}: {len(args.numbers)} tags of {args.side:g} mm; print at 100 % and measure the ruler: tag_size is the side of "
        "the black square on the print"
    )


def arguments() -> argparse.ArgumentParser:
    """Command line."""
    parser = argparse.ArgumentParser(prog="calibrate", description=DESCRIPTION)
    add_verbs(parser)
    return parser


def main() -> int:
    """Entry point."""
    args = arguments().parse_args()
    try:
        args.calibrate(args)
    except (CalibrationError, OSError) as error:
        print(f"calibrate: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
