# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The commands of an SVG path, checked by SVG's grammar and written out as M, L, C, Q, A and Z with absolute numbers.

svgelements mirrors the control point after S and T also where the command before was a curve of the other kind, stops
at a wrong number without a word, and does not read `0.`; what it gets from here leaves nothing to decide.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from fish_control.paths.svg.units import NUMBER, finite
from fish_control.reference_path import PathError

_SEPARATOR = re.compile(r"\s*,?\s*")
_N = re.compile(NUMBER)
_FLAG = re.compile("[01]")
_ARGUMENTS = {
    **{"M": (_N,) * 2, "L": (_N,) * 2, "T": (_N,) * 2, "H": (_N,), "V": (_N,), "Z": ()},
    **{"C": (_N,) * 6, "S": (_N,) * 4, "Q": (_N,) * 4},
    "A": (_N, _N, _N, _FLAG, _FLAG, _N, _N),
}
_MIRRORS = {
    "S": ("C", "CS"),
    "T": ("Q", "QT"),
}  # the full command, and those whose control point is mirrored


def absolute_commands(d: str, where: str) -> str:
    """The same path in absolute M, L, C, Q, A and Z.

    Raises:
        PathError: not a path by SVG's grammar; a viewer shows it up to the mistake only.

    """
    here = start = (0.0, 0.0)
    control, before = here, ""
    written = []
    for command, given in _commands(d, where):
        kind, numbers = _absolute(command, given, here)
        if kind in _MIRRORS:
            full, kinds = _MIRRORS[kind]
            mirrored = (2 * here[0] - control[0], 2 * here[1] - control[1])
            numbers = [*(mirrored if before and before in kinds else here), *numbers]
            written.append((full, numbers))
        else:
            written.append(("L" if kind in "HV" else kind, numbers))
        here = start if kind == "Z" else (numbers[-2], numbers[-1])
        start = here if kind == "M" else start
        control = (numbers[-4], numbers[-3]) if kind in "CSQT" else here
        before = kind
    return " ".join(f"{kind} {' '.join(map(repr, numbers))}" for kind, numbers in written)


def _absolute(
    command: str, given: list[float], here: tuple[float, float]
) -> tuple[str, list[float]]:
    """The command in upper case and its numbers from the drawing's origin; H and V get both coordinates."""
    kind, (x, y) = command.upper(), here if command.islower() else (0.0, 0.0)
    if kind == "H":
        return kind, [given[0] + x, here[1]]
    if kind == "V":
        return kind, [here[0], given[0] + y]
    if kind == "A":
        return kind, [*given[:3], int(given[3]), int(given[4]), given[5] + x, given[6] + y]
    return kind, [number + (y if k % 2 else x) for k, number in enumerate(given)]


def _commands(d: str, where: str) -> Iterator[tuple[str, list[float]]]:
    """Each command with its numbers; one that is given several times as many is given several times."""
    if d.strip()[:1] not in ("M", "m"):
        raise PathError(
            f"{where}: an SVG path begins with {d.strip()[:10]!r}, expected M and a point"
        )
    at, text = 0, d.rstrip()
    while at < len(text):
        at = _skip(text, at)
        command = text[at : at + 1]
        if command.upper() not in _ARGUMENTS:
            word = (text[at:].split() or [","])[0][:10]
            raise PathError(
                f"{where}: {word!r} in the outline, expected one of {' '.join(_ARGUMENTS)} and numbers"
            )
        at, repeated = at + 1, False
        if command.upper() == "Z":
            yield command, []
            continue
        while not repeated or _N.match(text, _skip(text, at)):
            at, numbers = _numbers(text, at, command, where)
            yield command, numbers
            command, repeated = {"M": "L", "m": "l"}.get(command, command), True


def _skip(text: str, at: int) -> int:
    match = _SEPARATOR.match(text, at)
    return match.end() if match else at


def _numbers(text: str, at: int, command: str, where: str) -> tuple[int, list[float]]:
    """The numbers of one command, and the place after them."""
    expected = _ARGUMENTS[command.upper()]
    numbers: list[float] = []
    for kind in expected:
        match = kind.match(text, _skip(text, at))
        if not match:
            came = (text[at:].split() or ["the end"])[0][:10]
            raise PathError(
                f"{where}: SVG command {command!r} has {len(numbers)} numbers and then {came!r}, expected"
                f" {len(expected)} numbers"
            )
        numbers.append(finite(match[0], where))
        at = match.end()
    return at, numbers
