# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The points of shapes: paths, lines, polygons, rectangles and ellipses.

The commands of a path are checked by SVG's grammar and written out as M, L, C, Q, A and Z with absolute numbers.
svgelements mirrors the control point after S and T also where the command before was a curve of the other kind, stops
at a wrong number without a word, and does not read `0.`; what it gets from here leaves nothing to decide.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from xml.etree.ElementTree import Element

import numpy as np
import svgelements
from numpy.typing import NDArray

from fish_control.paths.svg.coordinates import JOINT, NUMBER, finite, pixels
from fish_control.paths.svg.style import local_name
from fish_control.reference_path import PathError

Array = NDArray[np.float64]


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


Outline = tuple[Array, bool]  # points (M, 2) in the shape's own units, and whether they are closed
Viewport = tuple[float, float]  # width and height that percentages refer to [px]

# of the curve's size, between a curve and its chords: an angle of 0.5 degrees on a circle
FLATNESS = 2e-6


def outlines(element: Element, viewport: Viewport, where: str) -> list[Outline]:
    """The parts of a shape, each drawn without lifting the pen; those of no length are left out.

    Raises:
        PathError: an outline that is not as SVG defines it.

    """
    path = _SHAPES[local_name(element)](element, viewport, where)
    parts: list[tuple[list[Array], bool]] = []
    restart = False
    for segment in path:
        if isinstance(segment, svgelements.Move):
            parts.append(([np.array(segment.end, dtype=float)[None]], False))
        elif isinstance(segment, svgelements.Close):
            parts[-1] = (parts[-1][0], True)
        else:
            if restart:  # after Z a new part begins where the last one began
                parts.append(([parts[-1][0][0]], False))
            parts[-1][0].append(_flatten(segment))
        restart = isinstance(segment, svgelements.Close)
    drawn = [(np.vstack(points), closed) for points, closed in parts]
    return [(points, closed) for points, closed in drawn if np.ptp(points, axis=0).any()]


def _flatten(segment: svgelements.PathSegment) -> Array:
    """Points on a segment without its first one, closer where it bends more."""
    end = np.array(segment.end, dtype=float)[None]
    straight = isinstance(segment, svgelements.Line)
    if straight or (isinstance(segment, svgelements.Arc) and not segment.rx * segment.ry):
        return end
    coarse = np.asarray(segment.npoint(np.linspace(0.0, 1.0, 33)), dtype=float)
    bend = np.linalg.norm(np.diff(coarse, 2, axis=0), axis=1).max() * 32.0**2  # second derivative
    size = np.ptp(coarse, axis=0).max()
    if not size:
        return end
    count = int(np.clip(np.sqrt(bend / (8.0 * FLATNESS * size)), 8, 1024))
    points: Array = np.asarray(segment.npoint(np.linspace(0.0, 1.0, count + 1)), dtype=float)[1:]
    points[-1] = end
    return points


def _path(element: Element, _: Viewport, where: str) -> svgelements.Path:
    return svgelements.Path(absolute_commands(element.get("d", ""), where))


def _vertices(element: Element, _: Viewport, where: str) -> svgelements.Path:
    numbers = re.split(rf"\s*,\s*|\s+|{JOINT}", element.get("points", "").strip())
    numbers = [] if numbers == [""] else numbers
    strange = [n for n in numbers if not re.fullmatch(NUMBER, n)]
    if strange or len(numbers) % 2:
        came = f"{strange[0]!r} among them" if strange else f"{len(numbers)} numbers"
        raise PathError(f"{where}: points have {came}, expected pairs of numbers x,y without units")
    points = np.array([finite(n, where) for n in numbers]).reshape(-1, 2)
    closed = local_name(element) == "polygon"
    if len(points) < 2:
        raise PathError(f"{where}: {len(points)} points; 2 are needed")
    commands = " L ".join(f"{x!r},{y!r}" for x, y in points.tolist())
    return svgelements.Path(f"M {commands}{' Z' if closed else ''}")


def _line(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    x1, x2 = (_length(element, key, viewport[0], where) for key in ("x1", "x2"))
    y1, y2 = (_length(element, key, viewport[1], where) for key in ("y1", "y2"))
    return svgelements.Path(f"M {x1!r},{y1!r} L {x2!r},{y2!r}")


def _rect(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    x, width = (_length(element, key, viewport[0], where) for key in ("x", "width"))
    y, height = (_length(element, key, viewport[1], where) for key in ("y", "height"))
    given = {
        key: _length(element, key, viewport[side], where)
        for side, key in enumerate(("rx", "ry"))
        if element.get(key, "auto").strip() != "auto"
    }
    if not (width > 0.0 and height > 0.0):
        return svgelements.Path()
    rx = min(given.get("rx", given.get("ry", 0.0)), width / 2.0)
    ry = min(given.get("ry", given.get("rx", 0.0)), height / 2.0)
    return svgelements.Path(svgelements.Rect(x, y, width, height, rx, ry))


def _ellipse(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    cx, cy = (_length(element, key, viewport[i], where) for i, key in enumerate(("cx", "cy")))
    if local_name(element) == "circle":
        diagonal = float(np.hypot(*viewport) / np.sqrt(2.0))  # SVG 2, section 8.9
        rx = ry = _length(element, "r", diagonal, where)
    else:
        rx, ry = (_length(element, key, viewport[i], where) for i, key in enumerate(("rx", "ry")))
    if not (rx > 0.0 and ry > 0.0):
        return svgelements.Path()
    return svgelements.Path(svgelements.Ellipse(cx=cx, cy=cy, rx=rx, ry=ry))


def _length(element: Element, key: str, whole: float, where: str) -> float:
    return pixels(element.get(key, "").strip() or "0", f"{where}: {key}", whole)


_SHAPES: dict[str, Callable[[Element, Viewport, str], svgelements.Path]] = {
    "path": _path,
    "polyline": _vertices,
    "polygon": _vertices,
    "line": _line,
    "rect": _rect,
    "circle": _ellipse,
    "ellipse": _ellipse,
}
SHAPES = tuple(_SHAPES)
