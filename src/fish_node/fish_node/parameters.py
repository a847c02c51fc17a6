# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names and types of parameters, without ROS."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import Any

ROS_NAMES = (
    "use_sim_time",
    "start_type_description_service",
)  # and qos_overrides: ROS's own parameters


def in_type_of(name: str, given: Any, like: Any) -> Any:
    """given in the type of like: whole numbers may stand for floats, lists for tuples, YAML 1.1's truth values for Y and N.

    Raises:
        ValueError: another type; names the parameter, what came and what was expected.
    """
    if (
        isinstance(like, tuple)
        and not isinstance(given, str | bytes)
        and hasattr(given, "__iter__")
    ):
        return tuple(in_type_of(name, item, like[0]) for item in given)
    if isinstance(like, float) and isinstance(given, int) and not isinstance(given, bool):
        return float(given)
    if isinstance(like, str) and len(like) == 1 and isinstance(given, bool):
        return "Y" if given else "N"
    if type(given) is not type(like):
        raise ValueError(f"{name} is {given!r}, expected {type(like).__name__} such as {like!r}")
    return given


def unknown_names(given: Iterable[object], known: Collection[str]) -> str:
    """What is wrong with the names of parameters, and what may have been meant; empty if all are known or ROS's own."""
    unknown = sorted(str(name) for name in given if not (name in known or is_of_ros(str(name))))
    if not unknown:
        return ""
    near = [match for name in unknown for match in get_close_matches(name, known, n=1)]
    hint = f" (did you mean {', '.join(near)}?)" if near else ""
    return f"unknown parameter {', '.join(unknown)}{hint}; known: {', '.join(sorted(known))}"


def is_of_ros(name: str) -> bool:
    """Whether ROS itself has a parameter of this name for every node."""
    return name in ROS_NAMES or name.startswith("qos_overrides.")
