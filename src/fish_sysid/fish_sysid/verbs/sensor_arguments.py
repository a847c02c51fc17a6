# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arguments of a robot's sensors, for verbs that look ahead of any recording."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fish_sysid.design.noise_free import SensorSet


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
    from fish_sysid.design.noise_free import SensorSet

    return SensorSet(args.camera_rate, args.imu_rate, args.encoder_rate)
