# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Open-loop programs of stroke and rudder, for recordings from which a model is identified. No ROS, no clock.

phi_dot = A w sin(phase),   phase' = w = 2 pi f        rotor (MODEL, rotor and throttle)
alpha   = rudder                                       as a step: what the servo makes of it is to be seen
"""

from __future__ import annotations

import bisect
import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from fish_control.control_law import AMPLITUDE_AT_FULL_THROTTLE, ControlLimits
from fish_control.controller import Command
from fish_control.stroke_mean import STROKE_FREQUENCY
from fish_report.files import GivenTwiceError, UniqueLoader, unique_names

LATEST_ROW = 3600.0  # s
LAST_ROW = 8.0  # s that the last row lasts
LATEST_END = 2.0 * LATEST_ROW  # s
FASTEST_STROKE = 4.0  # Hz
# rad/s, at full throttle
FASTEST_ROTOR = AMPLITUDE_AT_FULL_THROTTLE * 2.0 * math.pi * STROKE_FREQUENCY
FREQUENCY_RATE = 4.0  # Hz/s; the rotor's speed must not jump
PERIOD = 0.01  # s between commands
STOPPING = 3.0  # s that a stopped fish holds its rudder, until it stands
LIMITS = ControlLimits()
EXPECTED = "a list of rows {t: s, amplitude: rad, frequency: Hz, rudder: rad}, alone, under `program` or in a diagnosis.json"


class ProgramError(ValueError):
    """A file is no program, or one that the fish cannot follow."""


class Row(NamedTuple):
    """What is commanded from t [s] on."""

    t: float
    amplitude: float  # rad, A of the rotor's oscillation
    frequency: float  # Hz
    rudder: float  # rad, positive steers left


@dataclass(frozen=True)
class Program:
    """Rows in the order of time; the last one lasts LAST_ROW, or until the last of `ends`."""

    rows: tuple[Row, ...]
    ends: tuple[float, ...] = ()  # s at which a swim ends and the next one begins from rest

    def __post_init__(self) -> None:
        if not self.rows:
            raise ProgramError(f"the program has no rows, expected {EXPECTED}")
        for number, row in enumerate(self.rows):
            _check(number, row)
        times = [row.t for row in self.rows]
        for number, (before, t) in enumerate(itertools.pairwise(times), 1):
            if t <= before:
                raise ProgramError(
                    f"row {number}: t is {t:g} s, expected more than the {before:g} s of the row before"
                )
        for number, end in enumerate(self.ends):
            if not 0.0 < end <= LATEST_END:
                raise ProgramError(
                    f"swim {number}: end is {end:g} s, expected more than 0 s and at most {LATEST_END:g} s"
                )
        if self.ends and (self.ends[-1] <= times[-1] or list(self.ends) != sorted(self.ends)):
            raise ProgramError(
                f"swims end at {', '.join(f'{t:g}' for t in self.ends)} s, expected times in order, the last after the last row "
                f"at {times[-1]:g} s"
            )

    @property
    def duration(self) -> float:
        """Time at which all ends [s]."""
        return self.ends[-1] if self.ends else self.rows[-1].t + LAST_ROW

    def end_of_swim(self, t: float) -> float:
        """End [s] of the swim that is under way, or begins, at t [s]."""
        return next((end for end in self.ends if end > t + 1e-9), self.duration)

    def at(self, t: float) -> Row:
        """The row of time t [s]."""
        return self.rows[max(bisect.bisect_right([row.t for row in self.rows], t) - 1, 0)]


def read_program(path: Path) -> Program:
    """The program of a JSON or YAML file.

    Raises:
        ProgramError: says what came and what was expected.
        OSError: the file cannot be read.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        if path.suffix == ".json":
            content = json.loads(text, object_pairs_hook=unique_names)
        else:
            content = yaml.load(text, Loader=UniqueLoader)
    except GivenTwiceError as error:
        raise ProgramError(f"{path}: {error}") from None
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        raise ProgramError(
            f"{path} is neither JSON nor YAML ({error.__class__.__name__}); expected {EXPECTED}"
        ) from None
    ends: tuple[float, ...] = ()
    for key in ("next_experiment", "program"):
        if isinstance(content, dict) and key in content:
            ends = _ends(path, content)
            content = content[key]
    if not isinstance(content, list):
        raise ProgramError(f"{path} holds {type(content).__name__}; expected {EXPECTED}")
    try:
        return Program(tuple(_row(number, entry) for number, entry in enumerate(content)), ends)
    except ProgramError as error:
        raise ProgramError(f"{path}: {error}") from None


def _ends(path: Path, content: dict[str, Any]) -> tuple[float, ...]:
    """When the swims of a calibration plan end [s]; none of other files."""
    swims = content.get("swims", [])
    if not isinstance(swims, list) or not all(
        isinstance(swim, dict) and "end" in swim for swim in swims
    ):
        raise ProgramError(f"{path}: swims is {swims!r}; expected a list of {{begin: s, end: s}}")
    ends = [
        _number(f"{path}: swim {number}: end", swim["end"]) for number, swim in enumerate(swims)
    ]
    return tuple(ends)


def command_table(program: Program, begin: float, end: float, glide: float) -> NDArray[np.float64]:
    """(T, 2) rotor speed [rad/s] and rudder [rad] every 10 ms from `begin` to `end` [s] and `glide` [s] beyond."""
    excitation = Excitation(program, begin, end)
    count = round((end - begin + glide) / PERIOD)
    commands = [excitation.command(PERIOD) for _ in range(count)]
    return np.array([[c.rotor_speed, c.alpha] for c in commands])


class Excitation:
    """Runs a program from `begin` to `end` [s] of its time, from a rotor at rest to a rotor at rest."""

    def __init__(self, program: Program, begin: float = 0.0, end: float = math.inf) -> None:
        self.program, self.end = program, min(end, program.duration)
        if not 0.0 <= begin < self.end:
            raise ProgramError(
                f"begin is {begin:g} s, expected 0 or more and less than the end at {self.end:g} s"
            )
        self.time = begin
        self._amplitude, self._phase = 0.0, 0.0
        self._frequency = program.at(begin).frequency
        self._held = 0.0  # rad, rudder of a stopped fish
        self._left: float | None = (
            None  # s for which it is still held; None while it was not stopped
        )

    @property
    def over(self) -> bool:
        """Whether the program has ended or was stopped."""
        return self.time >= self.end or self._left is not None

    def stop(self, rudder: float = 0.0) -> None:
        """Rotor to a stop for good, rudder to an angle [rad] until the fish stands."""
        self._held, self._left = rudder, STOPPING

    def command(self, dt: float) -> Command:
        """Advance by dt [s]; amplitude and frequency move at bounded rates, so that the rotor's speed does not jump.

        On their ways between two rows the two together may ask more of the rotor than either row does:

            phi_dot = min(A, FASTEST_ROTOR / w) w sin(phase)
        """
        if self.over:
            wanted = Row(self.time, 0.0, self._frequency, self._braking(dt))
        else:
            wanted = self.program.at(self.time)
            self.time += dt
        self._amplitude = _towards(self._amplitude, wanted.amplitude, LIMITS.amplitude_rate * dt)
        self._frequency = _towards(self._frequency, wanted.frequency, FREQUENCY_RATE * dt)
        w = 2.0 * math.pi * self._frequency
        self._phase = math.fmod(self._phase + w * dt, 2.0 * math.pi)
        amplitude = min(self._amplitude, FASTEST_ROTOR / w)
        return Command(self._phase, amplitude * w * math.sin(self._phase), wanted.rudder)

    def _braking(self, dt: float) -> float:
        """Rudder [rad] after the end."""
        if self._left is None or self._left <= 0.0:
            return 0.0
        self._left -= dt
        return self._held


def _towards(value: float, goal: float, step: float) -> float:
    return value + min(max(goal - value, -step), step)


def _row(number: int, entry: Any) -> Row:
    if not isinstance(entry, dict) or set(entry) != set(Row._fields):
        raise ProgramError(f"row {number} is {entry!r}; expected {{{', '.join(Row._fields)}}}")
    return Row(**{key: _number(f"row {number}: {key}", value) for key, value in entry.items()})


def _number(what: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        raise ProgramError(f"{what} is {value!r}, expected a finite number")
    return float(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _check(number: int, row: Row) -> None:
    for key, value, lowest, highest, unit in (
        ("t", row.t, 0.0, LATEST_ROW, "s"),
        ("amplitude", row.amplitude, 0.0, 10.0 * AMPLITUDE_AT_FULL_THROTTLE, "rad"),
        ("frequency", row.frequency, 0.1, FASTEST_STROKE, "Hz"),
        ("rudder", row.rudder, -LIMITS.rudder_range, LIMITS.rudder_range, "rad"),
    ):
        if not lowest <= value <= highest:
            raise ProgramError(
                f"row {number}: {key} is {value:g} {unit}, expected {lowest:g} to {highest:g} {unit}"
            )
    speed = row.amplitude * 2.0 * math.pi * row.frequency
    if speed > FASTEST_ROTOR + 1e-9:
        raise ProgramError(
            f"row {number}: amplitude and frequency ask the rotor for {speed:.0f} rad/s, expected {FASTEST_ROTOR:.0f} rad/s "
            "at most (amplitude times 2 pi frequency)"
        )
