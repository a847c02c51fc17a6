# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers, lengths, transforms and viewBoxes of SVG and CSS; what moves a point is a matrix."""

from __future__ import annotations

import math
import re
from xml.etree.ElementTree import Element

import numpy as np
import svgelements
from numpy.typing import NDArray

from fish_control.reference_path import PathError

Array = NDArray[np.float64]


METRES_PER_PIXEL = 0.0254 / 96.0  # CSS: 96 px are one inch
PIXELS = {
    "": 1.0,
    "px": 1.0,
    "in": 96.0,
    "cm": 96.0 / 2.54,
    "mm": 96.0 / 25.4,
    "q": 96.0 / 101.6,
    "pt": 96.0 / 72.0,
    "pc": 16.0,
}  # pixels in a unit, CSS Values and Units 3
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
JOINT = r"(?<=[\d.])(?=[-+])"  # between two numbers of which the second has a sign
_LENGTH = re.compile(rf"({NUMBER})([a-zA-Z]*|%)")


def pixels(text: str, where: str, whole: float | None = None) -> float:
    """A length [px]; `whole` is what 100 % are [px].

    Raises:
        PathError: no length, or in a unit that depends on a font or a window.

    """
    match = _LENGTH.fullmatch(text.strip())
    if match and match[2] == "%" and whole is not None:
        return finite(match[1], where) * whole / 100.0
    if not match or match[2].lower() not in PIXELS:
        raise PathError(f"{where} is {text!r}, expected a number in px, mm, cm, in, pt or pc")
    return finite(match[1], where) * PIXELS[match[2].lower()]


def finite(text: str, where: str) -> float:
    """A number that is not too large for a float."""
    value = float(text)
    if not math.isfinite(value):
        raise PathError(f"{where}: coordinate {text} is not finite")
    return value


def ratio(text: str, where: str) -> float:
    """A number or a percentage, as opacities have it."""
    match = re.fullmatch(rf"({NUMBER})(%?)", text.strip())
    if not match:
        raise PathError(f"{where} is {text!r}, expected a number from 0 to 1")
    return finite(match[1], where) / (100.0 if match[2] else 1.0)


_COUNTS = {
    **{"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3)},
    **{"skewX": (1,), "skewY": (1,)},
}  # functions and how many numbers each takes
_FUNCTION = re.compile(r"\s*,?\s*([A-Za-z]+)\s*\(([^()]*)\)")


def transform(text: str, where: str) -> Array:
    """The (3, 3) matrix of a transform attribute; it takes the element's units to those around it.

    Raises:
        PathError: another function than SVG's, or other numbers than it takes.

    """
    text = text.strip()
    if text.lower() in ("", "none"):
        return np.eye(3)
    matched = list(_FUNCTION.finditer(text))
    rest = _FUNCTION.sub("", text).strip()
    calls = []
    for match in matched:
        numbers = re.split(rf"\s*,\s*|\s+|{JOINT}", match[2].strip())
        numbers = [re.sub(r"(?<=\d)(deg|px)$", "", n) for n in numbers]
        if len(numbers) not in _COUNTS.get(match[1], ()) or not all(
            re.fullmatch(NUMBER, n) for n in numbers
        ):
            rest = match[0].strip()
            break
        calls.append(f"{match[1]}({','.join(repr(finite(n, where)) for n in numbers)})")
    if rest:
        raise PathError(
            f"{where}: transform {rest!r} is not one of {', '.join(_COUNTS)} with its numbers"
        )
    return _array(svgelements.Matrix(" ".join(calls)))


def viewbox_transform(
    element: Element, size: tuple[float, float], where: str
) -> tuple[Array, tuple[float, float]]:
    """Matrix from the units in an element with a viewBox to its viewport of `size` [px], and the size in those units.

    Raises:
        PathError: a viewBox that is no four numbers, or without extent.

    """
    text = element.get("viewBox", "").strip()
    if not text:
        return np.eye(3), size
    numbers = re.split(r"\s*,\s*|\s+", text)
    if len(numbers) != 4 or not all(re.fullmatch(NUMBER, n) for n in numbers):
        raise PathError(f"{where}: viewBox is {text!r}, expected four numbers")
    x, y, width, height = (finite(n, where) for n in numbers)
    if min(width, height, *size) <= 0.0:
        raise PathError(
            f"{where}: the viewBox or its frame has no width or no height, so nothing is shown"
        )
    aspect = element.get("preserveAspectRatio", "xMidYMid").strip() or "xMidYMid"
    if not re.fullmatch(r"(none|x(Min|Mid|Max)Y(Min|Mid|Max))(\s+(meet|slice))?", aspect):
        raise PathError(f"{where}: preserveAspectRatio {aspect!r} is not one of SVG's")
    calls = svgelements.Viewbox.viewbox_transform(0.0, 0.0, *size, x, y, width, height, aspect)
    return _array(svgelements.Matrix(calls)), (width, height)


def place(matrix: Array, points: Array) -> Array:
    """Points (M, 2) moved by a (3, 3) matrix."""
    placed: Array = points @ matrix[:2, :2].T + matrix[:2, 2]
    return placed


def _array(m: svgelements.Matrix) -> Array:
    return np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0.0, 0.0, 1.0]], dtype=float)
