# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a recording of an open-loop swim lacks: commands of the program, sensors, a fish that no wall touched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fish_bag.trial import Commands, Stream, Trial
from fish_control.excitation import Excitation, Program
from fish_control.pool import HALF_LENGTH, HALF_WIDTH
from fish_sim.model import DT

Array = NDArray[np.float64]

ON_TIME = 0.002  # s, a command may be stamped this far from its time
ALIKE = np.array(
    [1.0, 1e-3]
)  # rad/s, rad: what rotor speed and rudder may differ from those of the commands around
LONGEST_GAPS = {"imu": 0.05, "camera": 1.0}  # s without a sample while the program runs


def incomplete(trial: Trial, program: Program, begin: float, reached: float) -> list[str]:
    """What of the program from `begin` to `reached` [s] the recording lacks, a line each; none where all is there.

    trial: as recorded. Commands are those of `Excitation` every 10 ms, from the first that turns the rotor on.
    """
    trial = trial.clean()
    if trial.commands is None:
        return ["no joint_command was recorded"]
    wanted = commands_of(program, begin, reached)
    start = first_stroke(trial.commands, wanted)
    if start is None:
        return ["no joint_command turns the rotor"]
    found = list(_missing_commands(trial.commands, wanted, start))
    for role, longest in LONGEST_GAPS.items():
        found += _gaps(role, getattr(trial, role), start, start + DT * len(wanted), longest)
    if trial.truth is not None:
        at_wall = np.any(np.abs(trial.truth.pose[:, :2]) >= [HALF_LENGTH, HALF_WIDTH], axis=1)
        if at_wall.any():
            found.append(
                f"the fish touched a wall at {trial.truth.t[int(np.argmax(at_wall))] - start + begin:.2f} s of the program"
            )
    return found


def commands_of(program: Program, begin: float, reached: float) -> Array:
    """Phase [rad], rotor speed [rad/s] and rudder [rad] (N, 3) of the program, every 10 ms."""
    excitation, rows = Excitation(program, begin), []
    while excitation.time < reached - 0.5 * DT and not excitation.over:
        rows.append(excitation.command(DT))
    return np.array([[c.phase, c.rotor_speed, c.alpha] for c in rows]).reshape(-1, 3)


def first_stroke(commands: Commands, wanted: Array) -> float | None:
    """Time [s] at which the program begins in the recording: the phase of the first stroke tells it. None without one."""
    moves = np.flatnonzero(commands.rotor_phase > 0.0)
    if not len(moves) or not len(wanted):
        return None
    first = int(moves[0])
    wrapped = np.flatnonzero(np.diff(wanted[:, 0]) < 0.0)
    stroke = wanted[: wrapped[0] + 1 if len(wrapped) else None, 0]
    behind = int(np.argmin(np.abs(stroke - commands.rotor_phase[first])))
    return float(commands.t[first] - DT * behind)


def _missing_commands(commands: Commands, wanted: Array, start: float) -> Iterator[str]:
    """Stretches of the program without its commands, and commands that are not the program's.

    A row may begin a command earlier or later: the exciter's clock is not exact to the last bit.
    """
    times = start + DT * np.arange(len(wanted))
    at = np.clip(np.searchsorted(commands.t, times - ON_TIME), 0, len(commands) - 1)
    there = np.abs(commands.t[at] - times) <= ON_TIME
    for first, last in _stretches(~there):
        yield (
            f"joint_command is missing from {DT * first:.2f} to {DT * (last + 1):.2f} s after the first stroke"
            f" ({last - first + 1} commands)"
        )
    said = np.column_stack([commands.rotor_speed, commands.rudder])[at]
    around = np.stack(
        [wanted[np.clip(np.arange(len(wanted)) + k, 0, len(wanted) - 1), 1:] for k in (-1, 0, 1)]
    )
    low, high = around.min(axis=0) - ALIKE, around.max(axis=0) + ALIKE
    other = there & np.any((said < low) | (said > high), axis=1)
    if other.any():
        yield (
            f"{other.sum()} of {len(wanted)} commands are not the program's, the first {DT * int(np.argmax(other)):.2f} s after "
            "the first stroke"
        )


def _gaps(
    role: str, stream: Stream | None, start: float, end: float, longest: float
) -> Iterator[str]:
    """A sensor that was not recorded, or was silent for too long between two times [s]."""
    if stream is None:
        yield f"nothing of the {role} was recorded"
        return
    inside = stream.t[(stream.t > start) & (stream.t < end)]
    times = np.concatenate([[start], inside, [end]])
    gap = int(np.argmax(np.diff(times)))
    if times[gap + 1] - times[gap] > longest:
        yield (
            f"{stream.topic} is silent for {times[gap + 1] - times[gap]:.2f} s, {times[gap] - start:.2f} s after the first"
            f" stroke; expected {longest:g} s at most"
        )


def _stretches(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last place of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
