"""Outline of the first path, polyline or polygon of an SVG drawing."""

from __future__ import annotations

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
    """
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as error:
        raise PathError(f"{file}: not an SVG drawing ({error})") from error
    for element in root.iter():
        tag = element.tag.rsplit("}", 1)[-1]
        if tag in ("polyline", "polygon"):
            points = np.array([float(t) for t in _TOKEN.findall(element.get("points", ""))])
            return points[: len(points) // 2 * 2].reshape(-1, 2) * [1.0, -1.0], tag == "polygon"
        if tag == "path":
            points, closed = _outline(element.get("d", ""), file)
            return points * [1.0, -1.0], closed
    raise PathError(f"{file}: no path, polyline or polygon in the drawing")


def _outline(d: str, file: Path) -> tuple[Array, bool]:
    points = [np.zeros(2)]
    drawn: list[Array] = []
    control: Array | None = None
    for command, numbers in _segments(d, file):
        here = points[-1]
        if command.upper() == "Z":
            return np.array(drawn), True
        if command.upper() == "M" and drawn:
            raise PathError(
                f"{file}: the outline has several parts; a fish cannot lift off, draw it in one stroke"
            )
        absolute = numbers if command.isupper() else numbers + _origin(command, here)
        new, control = _CURVES[command.upper()](here, absolute, control)
        points.append(new[-1])
        drawn.extend(new)
    return np.array(drawn), False


def _origin(command: str, here: Array) -> Array:
    """What relative coordinates are relative to."""
    if command in "hv":
        return here[:1] if command == "h" else here[1:]
    return np.tile(here, _ARGUMENTS[command.upper()] // 2)


def _segments(d: str, file: Path) -> Iterator[tuple[str, Array]]:
    """(command, its numbers), repeated commands written out."""
    tokens = _TOKEN.findall(d)
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
        count = _ARGUMENTS.get(command.upper(), 0)
        numbers = tokens[i : i + count]
        if (
            len(numbers) < count
            or any(t.isalpha() for t in numbers)
            or (count == 0 and command.upper() != "Z")
        ):
            raise PathError(
                f"{file}: SVG command '{command}' is followed by {numbers}, expected {count} numbers"
            )
        yield command, np.array([float(t) for t in numbers])
        i += count
        command = {"M": "L", "m": "l"}.get(command, command)
        if count == 0:
            return


def _bezier(controls: list[Array]) -> Array:
    """De Casteljau at CURVE_POINTS parameters, without the first point."""
    t = np.linspace(0.0, 1.0, CURVE_POINTS + 1)[1:, None]
    levels = [np.broadcast_to(c, (CURVE_POINTS, 2)) for c in controls]
    while len(levels) > 1:
        levels = [(1.0 - t) * a + t * b for a, b in zip(levels, levels[1:], strict=False)]
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
