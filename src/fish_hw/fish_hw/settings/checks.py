"""Checks shared by the settings; each error names the field, its value and what is allowed."""

import math
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import Any

ROS_NAMES = ("use_sim_time", "start_type_description_service")  # and qos_overrides: ROS's own parameters


def require_range(name: str, value: float, low: float, high: float) -> None:
    """ValueError unless low <= value <= high (NaN fails)."""
    if not (math.isfinite(value) and low <= value <= high):
        raise ValueError(f"{name} is {value}, expected {low} to {high}")


def require_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    """ValueError unless value is one of choices."""
    if value not in choices:
        raise ValueError(f"{name} is {value!r}, expected one of {', '.join(repr(c) for c in choices)}")


def in_type_of(default: Any, value: Any, name: str) -> Any:
    """value, of the same type as default; a whole number may stand for a float (rate_hz:=100)."""
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(value) is not type(default):
        raise ValueError(f"{name} is {value!r}, expected {type(default).__name__} such as {default!r}")
    return value


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
