"""Outline of the first path, polyline or polygon of an SVG drawing."""

from __future__ import annotations

import itertools
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.reference_path import PathError

Array = NDArray[np.float64]

CURVE_POINTS = 64  # points for each Bezier segment
_TOKEN = re.compile(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "Z": 0}


def read_svg(file: Path) -> tuple[Array, bool]:
    """Points (M, 2) in drawing units with y up, and whether the outline is closed.

    Straight lines and Bezier curves are understood (M L H V C S Q T Z, upper and lower case); transforms are
    not.

    Raises:
        PathError: not an SVG drawing, or one that cannot be swum in one stroke.
    """
    try:
        root = ElementTree.parse(file).getroot()
    except (
        ElementTree.ParseError,
        LookupError,
        ValueError,
    ) as error:  # the last two: an unknown encoding
        raise PathError(f"{file}: not an SVG drawing ({error})") from error
    for element in root.iter():
        tag = element.tag.rsplit("}", 1)[-1]
        if tag in ("polyline", "polygon"):
            return _vertices(element.get("points", ""), file) * [1.0, -1.0], tag == "polygon"
        if tag == "path":
            points, closed = _outline(element.get("d", ""), file)
            return points * [1.0, -1.0], closed
    raise PathError(f"{file}: no path, polyline or polygon in the drawing")


def _vertices(points: str, file: Path) -> Array:
    tokens = _tokens(points, file)
    letters = [t for t in tokens if t.isalpha()]
    if letters or len(tokens) % 2:
        came = f"{letters[0]!r} among them" if letters else f"{len(tokens)} numbers"
        raise PathError(f"{file}: points have {came}, expected pairs of numbers x,y without units")
    return np.array([_number(t, file) for t in tokens]).reshape(-1, 2)


def _tokens(text: str, file: Path) -> list[str]:
    """Letters and numbers; only space and commas may stand between them."""
    strange = _TOKEN.sub("", text).replace(",", "").split()
    if strange:
        raise PathError(f"{file}: {strange[0]!r} in the outline, expected commands and numbers")
    return _TOKEN.findall(text)


def _number(token: str, file: Path) -> float:
    if not math.isfinite(float(token)):
        raise PathError(f"{file}: coordinate {token} is not finite")
    return float(token)


def _outline(d: str, file: Path) -> tuple[Array, bool]:
    points = [np.zeros(2)]
    drawn: list[Array] = []
    control: Array | None = None
    closed = False
    for command, numbers in _segments(d, file):
        here = points[-1]
        if command.upper() == "Z":
            closed = True
            continue
        if closed or (command.upper() == "M" and drawn):
            raise PathError(
                f"{file}: the outline has several parts; a fish cannot lift off, draw it in one stroke"
            )
        absolute = numbers if command.isupper() else numbers + _origin(command, here)
        new, control = _CURVES[command.upper()](here, absolute, control)
        points.append(new[-1])
        drawn.extend(new)
    return np.array(drawn), closed


def _origin(command: str, here: Array) -> Array:
    """What relative coordinates are relative to."""
    if command in "hv":
        return here[:1] if command == "h" else here[1:]
    return np.tile(here, _ARGUMENTS[command.upper()] // 2)


def _segments(d: str, file: Path) -> Iterator[tuple[str, Array]]:
    """(command, its numbers), repeated commands written out."""
    if d.strip()[:1].upper() != "M":
        raise PathError(
            f"{file}: an SVG path begins with {d.strip()[:10]!r}, expected M and a point"
        )
    tokens = _tokens(d, file)
    i = 0
    command = ""
    while i < len(tokens):
        if tokens[i].isalpha():
            command = tokens[i]
            i += 1
            if command.upper() not in _ARGUMENTS:
                raise PathError(
                    f"{file}: SVG command '{command}' is not supported; known: {' '.join(_ARGUMENTS)}"
                )
        elif command.upper() == "Z":
            raise PathError(
                f"{file}: SVG command '{command}' is followed by {tokens[i]}, expected no numbers"
            )
        count = _ARGUMENTS[command.upper()]
        numbers = tokens[i : i + count]
        if len(numbers) < count or any(t.isalpha() for t in numbers):
            raise PathError(
                f"{file}: SVG command '{command}' is followed by {numbers}, expected {count} numbers"
            )
        yield command, np.array([_number(t, file) for t in numbers])
        i += count
        command = {"M": "L", "m": "l"}.get(command, command)


def _bezier(controls: list[Array]) -> Array:
    """De Casteljau at CURVE_POINTS parameters, without the first point."""
    t = np.linspace(0.0, 1.0, CURVE_POINTS + 1)[1:, None]
    levels = [np.broadcast_to(c, (CURVE_POINTS, 2)) for c in controls]
    while len(levels) > 1:
        levels = [(1.0 - t) * a + t * b for a, b in itertools.pairwise(levels)]
    return levels[0]


_Drawn = tuple[Array, Array | None]


def _line(_: Array, n: Array, __: Array | None) -> _Drawn:
    return n[None], None


def _cubic(here: Array, n: Array, _: Array | None) -> _Drawn:
    return _bezier([here, n[:2], n[2:4], n[4:]]), 2.0 * n[4:] - n[2:4]


def _smooth_cubic(here: Array, n: Array, mirrored: Array | None) -> _Drawn:
    return _cubic(here, np.r_[here if mirrored is None else mirrored, n], None)


def _quadratic(here: Array, n: Array, _: Array | None) -> _Drawn:
    return _bezier([here, n[:2], n[2:]]), 2.0 * n[2:] - n[:2]


def _smooth_quadratic(here: Array, n: Array, mirrored: Array | None) -> _Drawn:
    return _quadratic(here, np.r_[here if mirrored is None else mirrored, n], None)


_CURVES: dict[str, Callable[[Array, Array, Array | None], _Drawn]] = {
    "M": _line,
    "L": _line,
    "H": lambda here, n, _: (np.array([[n[0], here[1]]]), None),
    "V": lambda here, n, _: (np.array([[here[0], n[0]]]), None),
    "C": _cubic,
    "S": _smooth_cubic,
    "Q": _quadratic,
    "T": _smooth_quadratic,
}
