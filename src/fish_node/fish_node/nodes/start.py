# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every node does to start and to stop: parameters from a dataclass, a clean end."""

import sys
from collections.abc import Callable, Collection
from dataclasses import asdict
from typing import TypeVar

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from fish_node.nodes.descriptors import descriptors
from fish_node.nodes.executor import spin
from fish_node.parameters import in_type_of, unknown_names

Config = TypeVar("Config")
Made = TypeVar("Made", bound=Node)
REFUSALS = (ValueError, OSError, RCLError)  # of arguments, of parameters, of files that they name


def read_parameters(node: Node, kind: type[Config], settable: Collection[str] = ()) -> Config:
    """Declare every field of a dataclass as ROS parameter and read them; the defaults are those of the dataclass.

    Each gets a descriptor with unit, meaning and range. They are read once and then read-only, except those that the node
    takes over at run time (nodes/changes.py). The node must have been made with
    automatically_declare_parameters_from_overrides: a misspelt name would go unnoticed.

    Args:
        node: has no parameters of its own yet.
        kind: the dataclass.
        settable: names of the parameters that the node takes over at run time.

    Raises:
        ValueError: an unknown name, or a value of the wrong type or out of range, naming parameter, value and
            what was expected.
    """
    defaults = asdict(kind())  # type: ignore[call-overload]
    if unknown := unknown_names(node.get_parameters_by_prefix(""), defaults):
        raise ValueError(unknown)
    values = {}
    for name, like in defaults.items():
        given = node.get_parameter(name).value if node.has_parameter(name) else like
        values[name] = in_type_of(name, given, like)
    config = kind(**values)
    for name, descriptor in descriptors(config, settable).items():
        if node.has_parameter(name):  # declared with the type that came, and without a descriptor
            node.undeclare_parameter(name)
        value = values[name]
        start = list(value) if isinstance(value, tuple) else value
        node.declare_parameter(name, start, descriptor, ignore_override=True)
    return config


def run(
    make_node: Callable[[], Made], name: str, at_end: Callable[[Made], None] | None = None
) -> int:
    """Spin a node until SIGINT or SIGTERM: 0; or 1 and one line on stderr if its arguments are refused.

    A signal may come while the node is still being made: its context ends there and then, and whatever that makes fail is
    no failure. Errors of callbacks are the caller's.

    Args:
        make_node: the node's class.
        name: for the line on stderr.
        at_end: is handed the node on the clean way out, not after an error.
    """
    try:
        rclpy.init()
    except REFUSALS as error:
        return _refused(name, error)
    node = None
    try:
        try:
            node = make_node()
            spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        except Exception:
            if rclpy.ok():
                raise
        if node is not None and at_end is not None:
            at_end(node)
    except REFUSALS as error:
        if node is not None:  # not a refused argument but a mistake in a callback
            raise
        return _refused(name, error)
    finally:
        if node is not None:
            node.destroy_node()
        shut_down()
    return 0


def shut_down() -> None:
    """End the context. After a signal its own thread may be doing the same, and the slower of the two fails."""
    try:
        rclpy.try_shutdown()
    except RCLError:
        rclpy.try_shutdown()


def _refused(name: str, error: Exception) -> int:
    print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
    return 1
