"""What every node of this package does to start and to stop: parameters from a dataclass, a clean end."""

import sys
from collections.abc import Callable, Collection
from dataclasses import fields
from difflib import get_close_matches
from typing import TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from fish_vision.config import in_type_of

Config = TypeVar("Config")
ROS_NAMES = ("use_sim_time", "start_type_description_service")  # and qos_overrides: ROS's own parameters


def read_parameters(node: Node, kind: type[Config]) -> Config:
    """Declare every field of a dataclass as ROS parameter and read them; the defaults are those of the
    dataclass.

    Raises:
        ValueError: an unknown name, or a value of the wrong type or out of range, naming parameter, value and
            what was expected.
    """
    refuse_unknown(node, [field.name for field in fields(kind)])  # type: ignore[arg-type]
    default = kind()
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
        like = getattr(default, field.name)
        start = list(like) if isinstance(like, tuple) else like
        if node.has_parameter(field.name):  # declared with the type that came, which may not be the right one
            node.undeclare_parameter(field.name)
        given = node.declare_parameter(field.name, start, ParameterDescriptor(dynamic_typing=True)).value
        values[field.name] = in_type_of(field.name, given, like)
    return kind(**values)


def refuse_unknown(node: Node, known: Collection[str]) -> None:
    """ValueError for parameters that were given to a node and that it does not know: a misspelt one would go unnoticed.

    The node must have been made with automatically_declare_parameters_from_overrides.
    """
    given = node.get_parameters_by_prefix("")
    unknown = sorted(name for name in given if not (name in known or is_of_ros(name)))
    if unknown:
        raise ValueError(
            f"unknown parameter {', '.join(unknown)}{nearest(unknown, known)}; known: {', '.join(sorted(known))}"
        )


def is_of_ros(name: str) -> bool:
    """Whether ROS itself has a parameter of this name for every node."""
    return name in ROS_NAMES or name.startswith("qos_overrides.")


def nearest(unknown: Collection[str], known: Collection[str]) -> str:
    """What may have been meant, in brackets; empty if nothing is like it."""
    near = [match for name in unknown for match in get_close_matches(name, known, n=1)]
    return f" (did you mean {', '.join(near)}?)" if near else ""


def _init() -> None:
    """Start rclpy; ValueError if it refuses the command line."""
    try:
        rclpy.init()
    except RuntimeError as error:  # rclpy's RCLError
        raise ValueError(str(error)) from error


def run(make_node: Callable[[], Node], name: str) -> int:
    """Spin a node until SIGINT or SIGTERM: 0; or 1 and one line on stderr if its arguments are refused.

    Errors of callbacks are the caller's.
    """
    node = None
    try:
        _init()
        node = make_node()
        rclpy.spin(node)
    except ValueError as error:
        if node is not None:  # not a refused parameter but a mistake in a callback
            raise
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except RuntimeError:  # rclpy's RCLError: a callback published after the signal had shut the context down
        if rclpy.ok():
            raise
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
