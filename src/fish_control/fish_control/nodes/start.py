"""What every node of this package does to start and to end: parameters from a dataclass, a clean end."""

import sys
from collections.abc import Callable
from dataclasses import fields
from typing import TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

Config = TypeVar("Config")


def read_parameters(node: Node, kind: type[Config]) -> Config:
    """Declare every field of a dataclass as a parameter and build the dataclass from what is set.

    Raises:
        ValueError: wrong type or value; names the parameter, what came and what was expected.
    """
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
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
