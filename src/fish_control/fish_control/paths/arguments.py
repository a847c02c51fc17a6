# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arguments of a path family as a user types them."""

from __future__ import annotations

import yaml

from fish_control.reference_path import PathError


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
