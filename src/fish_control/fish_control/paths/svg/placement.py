# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Transforms and viewBoxes as matrices."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

import numpy as np
import svgelements
from numpy.typing import NDArray

from fish_control.paths.svg.units import JOINT, NUMBER, finite
from fish_control.reference_path import PathError

Array = NDArray[np.float64]

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
