# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate tags: a sheet of coded tags to print, for the fish or for known places of the pool."""

import argparse
from pathlib import Path
from typing import Any

from fish_vision.calibration import CalibrationError
from fish_vision.commands.pictures import new_file
from fish_vision.tag_sheet import PAGES, tag_sheet


def add_parser(verbs: Any) -> None:
    """The sub-command."""
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
