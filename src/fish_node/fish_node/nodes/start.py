# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every node does to start and to stop: parameters from a dataclass, a clean end."""

import faulthandler
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, Generic, TypeVar

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from fish_node.nodes.parameters import descriptors
from fish_node.nodes.spin import ByWaitSet, Spin
from fish_node.parameters import in_type_of, unknown_names

Config = TypeVar("Config")
Made = TypeVar("Made", bound=Node)
# of arguments, of parameters, of files that they name
REFUSALS = (ValueError, OSError, RCLError, UnknownROSArgsError)
END_S = 60.0  # s; a node's own way out, such as the rest of a recording, is in it
STDERR = 2  # file descriptor: sys.stderr may be anything


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


@dataclass(frozen=True)
class Part(Generic[Made]):
    """One node of a process.

    Attributes:
        make: makes the node.
        name: for the line on stderr.
        at_end: is handed the node on the clean way out, not after an error.
    """

    make: Callable[[], Made]
    name: str
    at_end: Callable[[Made], None] | None = None


def run(
    make_node: Callable[[], Made],
    name: str,
    at_end: Callable[[Made], None] | None = None,
    spin: Spin | None = None,
) -> int:
    """Spin a node until SIGINT or SIGTERM; run_together with one part."""
    return run_together([Part(make_node, name, at_end)], spin=spin)


def run_together(
    parts: Sequence[Part[Any]], arguments: list[str] | None = None, spin: Spin | None = None
) -> int:
    """Spin nodes in one process until SIGINT or SIGTERM: 0; or 1 and one line on stderr if their arguments are refused.

    A signal may come while a node is still being made: the context ends there and then, and whatever that makes fail is
    no failure. Errors of callbacks are the caller's.

    Args:
        parts: the nodes.
        arguments: command line, instead of the process's own.
        spin: which executor runs the callbacks; a wait set unless said otherwise.
    """
    part, nodes, spin = parts[0], list[Node](), spin or ByWaitSet()
    try:
        spin.init(arguments)
    except REFUSALS as error:
        return _refused(part.name, error)
    try:
        try:
            for part in parts:
                nodes.append(part.make())
            spin(nodes)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        except Exception:
            if rclpy.ok():
                raise
        for part, node in zip(parts, nodes, strict=False):  # a signal may come before all are made
            if part.at_end is not None:
                part.at_end(node)
    except REFUSALS as error:
        if len(nodes) == len(parts):  # not a refused argument but a mistake in a callback
            raise
        return _refused(part.name, error)
    finally:
        with ended_within(END_S):
            for node in nodes:
                node.destroy_node()
            shut_down()
    return 0


@contextmanager
def ended_within(limit_s: float) -> Iterator[None]:
    """End the process with status 1, and say on stderr where it stood, if what is done inside takes longer than limit_s.

    Fast DDS sometimes never comes back from the end of its participant and keeps the interpreter's lock meanwhile, so that no
    thread of Python could end the process (Fast-DDS issue 6502).
    """
    faulthandler.dump_traceback_later(limit_s, exit=True, file=STDERR)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def shut_down() -> None:
    """End the context. After a signal its own thread may be doing the same, and the slower of the two fails."""
    try:
        rclpy.try_shutdown()
    except RCLError:
        rclpy.try_shutdown()


def _refused(name: str, error: Exception) -> int:
    unknown = isinstance(error, UnknownROSArgsError)
    said = f"unknown ROS arguments {error}; --help says what there is" if unknown else str(error)
    print(f"{name}: {' '.join(said.split())}", file=sys.stderr)
    return 1
