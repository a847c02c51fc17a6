# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands as the robot followed them: those that the recorder lost, and those that were forgotten.

A command held over a gap drives the model with a constant rotor speed, which the robot's was not: 10 ms of it cost 400 nats,
50 ms 5000, which a diagnosis takes for a force. The encoder measured the rotor's speed. Where it is silent too, a curve through
two commands on each side follows the strokes, or a line where two of these are close together. The rudder, which is not measured
and may jump, is interpolated linearly.
Commands that come late or on events were held by the robot as well. Only where nearly all come at a regular interval is a
missed one a loss. Where they come irregularly and the rotor moves at other times than their stamps say, as on a computer that
is too slow for the controller, the measured speed drives the model throughout.

A controller that has ended leaves its last command standing while the motor is off and the rotor runs down. The model is
driven by the measured speed there, and the encoder's distance from the forgotten command is no residual. A servo has no
feedback: it keeps the last command that it was given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import KroghInterpolator

from fish_sim.model import DT

Array = NDArray[np.float64]

FEWEST = 10  # commands that make a beat
ON_THE_BEAT = 0.1  # of the median interval; timers keep to it, answers to events do not
REGULAR = 0.8  # share of intervals on the beat; one in ten messages may be lost
MISSED = 1.8  # medians; a lost message makes two of it, a late one rarely so much
LONGEST = 0.1  # s between two commands; over more the rudder is unknown
AROUND = 2  # commands on each side that the curve runs through
CLOSE = 0.5  # medians between two of these; through closer ones a curve goes far off
STANDING = 0.5  # s; a command unchanged for longer may be a forgotten one
APART = 5.0  # rad/s between encoder and command; the noise of an encoder is less
# share of samples so far from irregular commands; a rotor that follows them has none
OFTEN_APART = 0.05
# distance over the commands' size; 28 ms late at 2 Hz are 0.35, a dead encoder has 1
SAME_MOTION = 0.35


class LostCommandsError(ValueError):
    """A gap is too long to fill; the message says when."""


def holes(t: Array) -> list[int]:
    """Which commands with stamps t (N,) [s] in order are the last before messages were lost; none where they come irregularly."""
    if len(t) < FEWEST:
        return []
    found: list[int] = np.flatnonzero(np.diff(t) > MISSED * _beat(t)).tolist()
    return found if _regular(t) else []


def commands_on_grid(t: Array, given: Array, grid: Array, encoder: Array) -> tuple[Array, Array]:
    """Commands (G, 2) and encoder (G,) less what was used for them, at times grid (G,) [s] from the first stamp on.

    t (N,) [s]: stamps in order; given (N, 2) rotor speed [rad/s] and rudder [rad]; encoder (G,) [rad/s], NaN without a sample.
    Raises LostCommandsError where a hole is too long, unless nothing moved in it.
    """
    held = np.clip(np.searchsorted(t, grid + 0.5 * DT, side="right") - 1, 0, len(t) - 1)
    commands, left = given[held], encoder.copy()
    if not_followed(t, given, grid, encoder):
        known = np.flatnonzero(np.isfinite(encoder))
        after = np.arange(1, len(encoder) + 1)  # the rotor has followed a command a step later
        commands[:, 0] = np.interp(after, known, encoder[known])
        left[:] = np.nan
    for last in holes(t):
        ends, beat = t[last : last + 2], _beat(t)
        if nothing_moved(given[last : last + 2], ends, grid, encoder):
            continue
        if ends[1] - ends[0] > LONGEST + ON_THE_BEAT * beat:
            raise LostCommandsError(
                f"no joint_command from {ends[0]:.2f} to {ends[1]:.2f} s, where one comes every {1e3 * beat:.0f} ms; expected at "
                f"most {LONGEST:g} s without; cut the recording there, or record it again"
            )
        lost = np.flatnonzero((held == last) & (grid + 0.5 * DT - ends[0] >= beat))
        read = encoder[lost + 1]  # the rotor has followed a command a step later
        near = slice(max(last + 1 - AROUND, 0), last + 1 + AROUND)
        if np.diff(t[near]).min() < CLOSE * beat:
            near = slice(last, last + 2)
        curve = KroghInterpolator(t[near] - ends[0], given[near, 0])(grid[lost] - ends[0])
        commands[lost, 0] = np.where(np.isfinite(read), read, curve)
        commands[lost, 1] = np.interp(grid[lost], ends, given[last : last + 2, 1])
        left[lost + 1] = np.nan
    # where the controller has ended the given rotor speed says, and not the measured one
    commands[:, 1] = held_rudder(given[held, 0], commands[:, 1])
    return commands, left


def nothing_moved(given: Array, ends: Array, grid: Array, encoder: Array) -> bool:
    """Whether a rotor at rest with the same rudder before and after a hole stood still in it, as its encoder shows.

    given (2, 2): commands at the ends (2,) [s] of the hole; grid and encoder as in `commands_on_grid`.
    """
    inside = (grid > ends[0]) & (grid < ends[1])
    known = grid[inside & np.isfinite(encoder)]
    gaps = np.diff([ends[0], *known, ends[1]])
    still = np.abs(encoder[inside & np.isfinite(encoder)]) < APART
    same = given[0, 0] == 0.0 and (given[0] == given[1]).all()
    return bool(same and gaps.max() <= LONGEST and still.all())


def not_followed(t: Array, given: Array, grid: Array, encoder: Array) -> bool:
    """Whether commands come irregularly and an encoder shows that the rotor moves at other times; as `commands_on_grid`.

    Never where the encoder is silent for longer than LONGEST, nor where it shows another motion, as a dead one does or one in
    another unit.
    """
    known = np.isfinite(encoder)
    ends = grid[np.concatenate([[0], np.flatnonzero(known), [len(grid) - 1]])]
    if len(t) < FEWEST or not known.any() or _regular(t) or np.diff(ends).max() > LONGEST:
        return False
    held = np.clip(np.searchsorted(t, grid - 0.5 * DT, side="right") - 1, 0, len(t) - 1)
    asked = given[held, 0][known]
    apart = np.abs(encoder[known] - asked)
    alike = np.linalg.norm(apart) < SAME_MOTION * np.linalg.norm(asked)
    return bool(alike and np.mean(apart > APART) > OFTEN_APART)


def _regular(t: Array) -> bool:
    beat = _beat(t)
    return bool(np.mean(np.abs(np.diff(t) - beat) <= ON_THE_BEAT * beat) >= REGULAR)


def _beat(t: Array) -> float:
    return float(np.median(np.diff(t)))


def driven(command: Array, encoder: Array) -> tuple[Array, Array]:
    """(rotor speed (T,) that drives the model, encoder (T,) less what was used for it), both [rad/s] on the grid of 10 ms.

    encoder: NaN at grid points without a sample.
    """
    speed, left = command.copy(), encoder.copy()
    for first, last in standing(command):
        # the rotor has followed a command a step later
        inside = np.flatnonzero(np.isfinite(encoder[first + 1 : last + 1])) + first + 1
        if len(inside) < 2 or np.median(np.abs(encoder[inside] - command[first])) < APART:
            continue
        speed[first:last] = np.interp(np.arange(first + 1, last + 1), inside, encoder[inside])
        left[first + 1 : last + 1] = np.nan
    return speed, left


def held_rudder(rotor: Array, rudder: Array) -> Array:
    """Rudder (T,) [rad] that a servo has which keeps its last command when the controller has ended.

    rotor (T,) [rad/s], rudder (T,) [rad]: commands. Where the rotor's command stands until the end of the trial the controller
    has ended; a rudder that is exactly 0 throughout that time was told nothing, and a servo told nothing stays where it is.
    """
    out = rudder.copy()
    stretches = [(a, b) for a, b in standing(rotor) if b == len(rotor) and a > 0]
    for first, _ in stretches:
        told = np.flatnonzero(rudder[: first + 1])
        if len(told) and not rudder[first:].any() and (first - told[-1]) * DT < STANDING:
            out[told[-1] + 1 :] = rudder[told[-1]]
    return out


def standing(command: Array) -> list[tuple[int, int]]:
    """(first, last) grid points, last excluded, of stretches in which a speed other than 0 stays the same."""
    edges = np.flatnonzero(np.diff(command, prepend=np.nan, append=np.nan) != 0)
    pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    return [(a, b) for a, b in pairs if (b - a) * DT > STANDING and command[a] != 0.0]
