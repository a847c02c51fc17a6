# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Units and signs of the rotor: command, measured speed and measured angle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fish_bag.problem import Problem
from fish_bag.record_comparison import FEWEST, FOLLOWS, correlation, unit_problem
from fish_bag.trial import Commands, Encoder

LARGEST_ROTOR_RAD_S = 1000.0


def check_commanded_speed(commands: Commands) -> Iterator[Problem]:
    """Speeds that no motor of such a robot reaches."""
    rotor = float(np.max(np.abs(commands.rotor_speed), initial=0.0))
    if rotor > LARGEST_ROTOR_RAD_S:
        text = (
            f"the rotor is commanded to {rotor:.4g} rad/s; expected at most {LARGEST_ROTOR_RAD_S:g}: "
            "rpm or deg/s? publish rad/s"
        )
        yield Problem("error", "rotor_unit", commands.topic, text)


def check_rotor(commands: Commands, encoder: Encoder | None) -> Iterator[Problem]:
    """Measured against commanded rotor speed; the sign is checked by `checks.check_rotor_sign`."""
    if encoder is None or len(commands) < FEWEST or len(encoder) < FEWEST:
        return
    wanted = np.interp(encoder.t, commands.t, commands.rotor_speed)
    if correlation(wanted, encoder.speed) > FOLLOWS:
        text = "the measured rotor speed is {} times the command"
        slope = float(np.std(encoder.speed) / np.std(wanted))
        yield from unit_problem("rotor_unit", encoder.topic, text, "rad/s", slope)


def check_encoder(encoder: Encoder) -> Iterator[Problem]:
    """The encoder's speed against the change of its angle, which may be wrapped."""
    if len(encoder) < FEWEST or np.ptp(encoder.speed) == 0 or np.ptp(encoder.angle) == 0:
        return
    change = np.diff(encoder.angle)
    if np.ptp(encoder.angle) <= 2 * np.pi + 0.1:
        change = np.mod(change + np.pi, 2 * np.pi) - np.pi
    elif np.ptp(encoder.angle) <= 360.5 and np.abs(change).max() > 180:
        change = np.mod(change + 180.0, 360.0) - 180.0
    steps = np.diff(encoder.t)
    if not (steps > 0).all():
        return
    mean = 0.5 * (encoder.speed[1:] + encoder.speed[:-1])
    rate = change / steps
    followed = correlation(rate, mean)
    if followed < -FOLLOWS:
        text = "the rotor's angle runs against its speed; expected the same sign in the driver"
        yield Problem("error", "encoder_sign", encoder.topic, text)
    elif followed > FOLLOWS:
        # of two records of one motion, the larger numbers are those in deg, rpm or thousandths
        slope = float(np.std(mean) / np.std(rate))
        text = "the rotor's measured speed is {} times the change of its angle"
        if slope < 1.0:
            slope, text = (
                1.0 / slope,
                "the change of the rotor's angle is {} times its measured speed",
            )
        yield from unit_problem("encoder_unit", encoder.topic, text, "rad and rad/s", slope)
