# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate lens | mount | colours | tags: make the files that tell the tracker about its camera and its light."""

import argparse
import sys

from fish_vision.calibration import CalibrationError
from fish_vision.commands import (
    calibrate_colours,
    calibrate_lens,
    calibrate_mount,
    calibrate_tags,
)


def arguments() -> argparse.ArgumentParser:
    """Command line."""
    parser = argparse.ArgumentParser(prog="calibrate", description=__doc__)
    add_verbs(parser)
    return parser


def add_verbs(parser: argparse.ArgumentParser) -> None:
    """Sub-commands of calibrate; each sets `calibrate`, the function to call."""
    verbs = parser.add_subparsers(required=True)
    for command in (calibrate_lens, calibrate_mount, calibrate_colours, calibrate_tags):
        command.add_parser(verbs)


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
