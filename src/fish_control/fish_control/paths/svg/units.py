# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lengths and numbers of SVG and CSS."""

from __future__ import annotations

import math
import re

from fish_control.reference_path import PathError

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
