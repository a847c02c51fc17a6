# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reference paths by name, one line a family here, and their arguments as a user types them."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import yaml

from fish_control.paths.closed_form import circle, figure_eight, sinusoid, square_wave, straight
from fish_control.paths.letter import letter
from fish_control.paths.polyline import polyline
from fish_control.reference_path import PathError, ReferencePath

PATHS: dict[str, Callable[..., ReferencePath]] = {
    "circle": circle,
    "figure_eight": figure_eight,
    "letter": letter,
    "polyline": polyline,
    "sinusoid": sinusoid,
    "square_wave": square_wave,
    "straight": straight,
}


def make_path(name: str, /, **arguments: object) -> ReferencePath:
    """Build a path by family name; a single letter means that letter, a .csv or .svg file that drawing.

    Raises:
        PathError: unknown family, unknown argument or bad value; lists what is known.
    """
    if len(name) == 1:
        name, arguments = "letter", {"letter": name, **arguments}
    elif name.lower().endswith((".csv", ".svg")):
        name, arguments = "polyline", {"file": name, **arguments}
    if name not in PATHS:
        raise PathError(
            f"unknown path {name!r}; known: {', '.join(PATHS)}, a letter A to Z, or a .csv or .svg file"
        )
    known = inspect.signature(PATHS[name]).parameters
    unknown = sorted(set(arguments) - set(known))
    if unknown:
        raise PathError(
            f"path '{name}' has no argument {', '.join(map(repr, unknown))}; known: {', '.join(known)}"
        )
    try:
        return PATHS[name](**arguments)
    except TypeError as error:
        raise PathError(f"path '{name}': an argument has the wrong type ({error})") from error


def read_arguments(text: str, name: str) -> dict[str, object]:
    """The table of a YAML text such as '{radius: 0.6}'; none where it is empty. `name`: what the user calls the text.

    Raises:
        PathError: no table of names and values.
    """
    try:
        arguments = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError):  # ValueError: a date that is none, 2020-13-45
        arguments = text
    if arguments is None:
        return {}
    if not isinstance(arguments, dict) or not all(isinstance(key, str) for key in arguments):
        raise PathError(f"{name} is {text!r}, expected YAML such as '{{radius: 0.6}}'")
    return arguments


__all__ = ["PATHS", "make_path", "read_arguments"]
