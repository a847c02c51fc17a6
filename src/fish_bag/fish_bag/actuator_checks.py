# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Units and signs of the rotor and the rudder.

Rotor: command, measured speed and measured angle. Rudder: the size of its commands, and the tail that it bends.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fish_bag.problem import Problem
from fish_bag.record_comparison import FEWEST, FOLLOWS, Array, correlation, integral, unit_problem
from fish_bag.trial import Camera, Commands, Encoder, Tail

LARGEST_ROTOR_RAD_S = 1000.0
LARGEST_RUDDER_RAD = 1.6  # no servo turns its rudder farther
SHORTEST_PULSE = 500.0  # us, of a servo
FULL_SCALE, STOPPED = (
    1.0,
    0.02,
)  # end of a normalised command, and the share of commands that stand there
TURN_RAD = 0.2  # standard deviation of the heading's change in a second
LEAST_RUDDER_RAD = 0.05  # standard deviation
DELAYS_S = (0.0, 0.15, 0.3)
MEAN_S = 1.0  # two strokes
LEAST_TAIL_RAD = 0.05  # standard deviation


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
    """The encoder's speed against the change of its angle, which may be wrapped, or absent."""
    encoder = encoder.take(np.isfinite(encoder.angle))
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


def check_rudder(commands: Commands) -> Iterator[Problem]:
    """Angles that no servo reaches, and a stop at exactly 1."""
    size = np.abs(commands.rudder)
    largest = float(np.max(size, initial=0.0))
    if largest > LARGEST_RUDDER_RAD:
        pulses = float(np.min(commands.rudder)) >= SHORTEST_PULSE
        guess = "servo pulses in us" if pulses else "per cent" if largest == 100.0 else "deg"
        text = f"the rudder goes to {largest:.4g} rad; expected at most {LARGEST_RUDDER_RAD}: {guess}? publish rad"
        yield Problem("error", "rudder_unit", commands.topic, text)
        return
    stopped = float(np.mean(np.abs(size - FULL_SCALE) < 1e-6)) if len(size) else 0.0
    if np.abs(largest - FULL_SCALE) < 1e-6 and stopped > STOPPED and np.ptp(commands.rudder) > 0:
        text = (
            f"the rudder stops at exactly {FULL_SCALE:g} in {stopped:.0%} of the commands: a servo command from "
            "-1 to 1? expected rad"
        )
        yield Problem("warning", "rudder_unit", commands.topic, text)


def check_tail(commands: Commands, tail: Tail) -> Iterator[Problem]:
    """The first tail segment rests at minus the rudder's angle: means over two strokes."""
    t = np.arange(
        max(commands.t[0], tail.t[0]) + MEAN_S, min(commands.t[-1], tail.t[-1]) - MEAN_S, 0.05
    )
    if len(t) < FEWEST or len(tail) < FEWEST or not tail.angle.shape[1]:
        return
    bent = _mean(tail.t, tail.angle[:, 0], t)
    set_to = _mean(commands.t, commands.rudder, t)
    if min(np.std(bent), np.std(set_to)) < LEAST_TAIL_RAD:
        return
    followed = correlation(set_to, bent)
    if followed > FOLLOWS:
        text = (
            f"the tail bends with the rudder (correlation {followed:.2f}); expected minus its angle: one of "
            "them has the wrong sign"
        )
        yield Problem("error", "tail_sign", tail.topic, text)
    elif followed < -FOLLOWS:
        text = "the tail's angle is {} times the rudder's"
        slope = float(np.std(bent) / np.std(set_to))
        yield from unit_problem("tail_unit", tail.topic, text, "rad of both", slope)


def rudder_follows(commands: Commands, camera: Camera) -> float | None:
    """Correlation of the turn in a second with the rudder, at the delay that fits best; None where either hardly varies."""
    start, end = max(commands.t[0], camera.t[0]) + 1.0, min(commands.t[-1], camera.t[-1]) - 1.0
    if end - start < 3.0 or len(camera) < FEWEST:
        return None
    t = np.arange(start, end, 0.05)
    psi = np.unwrap(camera.psi)
    turned = np.interp(t + 0.5, camera.t, psi) - np.interp(t - 0.5, camera.t, psi)
    means = [_mean(commands.t, commands.rudder, t - delay) for delay in DELAYS_S]
    if np.std(turned) < TURN_RAD or min(np.std(mean) for mean in means) < LEAST_RUDDER_RAD:
        return None
    return max((correlation(mean, turned) for mean in means), key=abs)


def _mean(times: Array, values: Array, t: Array) -> Array:
    """(T,) means over MEAN_S around t."""
    whole, half = integral(times, values), 0.5 * MEAN_S
    return (np.interp(t + half, times, whole) - np.interp(t - half, times, whole)) / MEAN_S
