"""What every node of this package does to start and to end: parameters from a dataclass, a clean end."""

import sys
from collections.abc import Callable, Collection
from dataclasses import fields
from difflib import get_close_matches
from typing import TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

Config = TypeVar("Config")
ROS_NAMES = ("use_sim_time", "start_type_description_service")  # and qos_overrides: ROS's own parameters


def read_parameters(node: Node, kind: type[Config]) -> Config:
    """Declare every field of a dataclass as a parameter and build the dataclass from what is set.

    Raises:
        ValueError: unknown name, wrong type or value; names the parameter, what came and what was expected.
    """
    refuse_unknown(node, [field.name for field in fields(kind)])  # type: ignore[arg-type]
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
        if node.has_parameter(field.name):  # declared with the type that came, which may not be the right one
            node.undeclare_parameter(field.name)
        given = node.declare_parameter(
            field.name, field.default, ParameterDescriptor(dynamic_typing=True)
        ).value
        if isinstance(field.default, float) and type(given) is int:
            given = float(given)
        if isinstance(field.default, str) and type(given) is bool and len(field.default) == 1:
            given = "Y" if given else "N"  # YAML 1.1 reads the letters Y and N as truth values
        if type(given) is not type(field.default):
            kind_name = type(field.default).__name__
            raise ValueError(f"{field.name} is {given!r}, expected {kind_name} such as {field.default!r}")
        values[field.name] = given
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


def run(make_node: Callable[[], Node], name: str) -> None:
    """Spin until SIGINT or SIGTERM (exit code 0); what cannot start says why in one line (exit code 1).

    Errors of callbacks are the caller's.
    """
    node = None
    failure = ""
    try:
        rclpy.init()
        node = make_node()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (ValueError, OSError, RCLError) as error:
        if node is None:
            failure = " ".join(str(error).split())
        elif rclpy.ok():  # else a callback published after the signal had shut the context down
            raise
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    if failure:
        sys.exit(f"{name}: {failure}")
