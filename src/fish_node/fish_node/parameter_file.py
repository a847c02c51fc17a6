# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One node's parameters from a ROS parameter file, without ROS: for commands that act where the node would."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import yaml

from fish_node.parameters import in_type_of, unknown_names

Settings = TypeVar("Settings")
PARAMETERS = "ros__parameters"
WILDCARDS = ("*", "**")
# name or pattern of nodes, with a slash in front; what stands below ros__parameters
Entry = tuple[str, yaml.Node]


def read_settings(
    path: Path,
    node: str,
    kind: type[Settings],
    say: Callable[[str], None],
    only: Collection[str] = (),
) -> Settings:
    """A dataclass of settings from what a file has for a node; what it does not have keeps its default.

    Args:
        path: YAML.
        node: full name, such as /fish/rudder; see read_node_parameters.
        kind: the dataclass.
        say: called with a message for unknown parameters, which are left out; it may raise.
        only: names of the fields that are needed, all if empty; what the file has for others is not looked at.

    Raises:
        ValueError: as read_node_parameters, or a value of the wrong type or out of range; names the file.
    """
    parameters, defaults = read_node_parameters(path, node), asdict(kind())  # type: ignore[call-overload]
    if unknown := unknown_names(parameters, defaults):
        say(f"{path}: {unknown}")
    needed = set(defaults) & set(only or defaults)
    known = {name: value for name, value in parameters.items() if name in needed}
    try:
        return kind(
            **{name: in_type_of(name, value, defaults[name]) for name, value in known.items()}
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def read_node_parameters(path: Path, node: str) -> dict[str, Any]:
    """The parameters that a file has for a node, as ROS reads it: entries whose names match, further down wins.

    The node is the one that is called `node` unless the file names one of that name in another namespace. Entries that this
    node would not read, though another robot's would, are refused: which of the two is meant cannot be known here.

    Args:
        path: YAML.
        node: full name, such as /fish/rudder.

    Raises:
        ValueError: unreadable, no parameter file, nothing for the node, or for several; names the file.
    """
    name = node.rpartition("/")[2]
    try:
        root = yaml.compose(path.read_text(encoding="utf-8"), yaml.SafeLoader)
        entries = [] if root is None else list(_entries(root))
        known = ", ".join(dict.fromkeys(pattern for pattern, _ in entries)) or "none"
        possible = [
            (p, below) for p, below in entries if p.rpartition("/")[2] in (name, *WILDCARDS)
        ]
        full = _meant([p for p, _ in possible], node)
        own = [
            _parameters(pattern, below) for pattern, below in possible if _matches(pattern, full)
        ]
    except (OSError, yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from error
    others = [pattern for pattern, _ in possible if not _matches(pattern, full)]
    if others:
        raise ValueError(
            f"{path}: {full} does not read {', '.join(others)}, which could be meant for it; found: {known}. "
            f"Expected entries of one robot only: /**, /**/{name} or {node}"
        )
    if not own:
        raise ValueError(
            f"{path}: nothing for the node {full}; expected a node name with {PARAMETERS} below it, such as /** or {node}; "
            f"found: {known}"
        )
    return {key: value for parameters in own for key, value in parameters.items()}


def _entries(node: yaml.Node, prefix: str = "") -> Iterator[Entry]:
    """Every ros__parameters with the name above it; names may be nested, and the same one may stand twice."""
    if not isinstance(node, yaml.MappingNode):
        return
    for key, value in node.value:
        if key.value == PARAMETERS and prefix:
            yield prefix, value
        elif isinstance(key, yaml.ScalarNode):
            yield from _entries(value, f"{prefix}/{key.value.strip('/')}")


def _meant(patterns: list[str], node: str) -> str:
    """`node`, or the only one that is named in full and in a namespace of its own."""
    named = {p for p in patterns if not set(WILDCARDS) & set(p.split("/")) and p.count("/") > 1}
    return named.pop() if len(named) == 1 else node


def _matches(pattern: str, node: str) -> bool:
    """As ROS does: * stands for one part of a name, ** for any number of them."""
    parts = {"*": r"/\w+", "**": r"(/\w+)*"}
    expression = "".join(parts.get(part, re.escape(f"/{part}")) for part in pattern.split("/")[1:])
    return re.fullmatch(expression, node) is not None


def _parameters(pattern: str, node: yaml.Node) -> dict[str, Any]:
    values = yaml.constructor.SafeConstructor().construct_document(node)
    if not isinstance(values, dict):
        raise ValueError(f"{PARAMETERS} of {pattern} is {values!r}, expected names and values")
    return values
