"""What every node does to start and to stop: parameters from a dataclass, a clean end."""

import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from fish_node.parameters import in_type_of, unknown_names

Config = TypeVar("Config")


def read_parameters(node: Node, kind: type[Config]) -> Config:
    """Declare every field of a dataclass as ROS parameter and read them; the defaults are those of the dataclass.

    They are read once: a change at run time is refused, since it would be reported as set and do nothing. The node must
    have been made with automatically_declare_parameters_from_overrides: a misspelt name would go unnoticed.

    Raises:
        ValueError: an unknown name, or a value of the wrong type or out of range, naming parameter, value and
            what was expected.
    """
    defaults = asdict(kind())  # type: ignore[call-overload]
    if unknown := unknown_names(node.get_parameters_by_prefix(""), defaults):
        raise ValueError(unknown)
    descriptor = ParameterDescriptor(dynamic_typing=True, read_only=True)
    values = {}
    for name, like in defaults.items():
        if node.has_parameter(name):  # declared with the type that came, which may not be the right one
            node.undeclare_parameter(name)
        start = list(like) if isinstance(like, tuple) else like
        given = node.declare_parameter(name, start, descriptor).value
        values[name] = in_type_of(name, given, like)
    return kind(**values)


def run(make_node: Callable[[], Node], name: str) -> int:
    """Spin a node until SIGINT or SIGTERM: 0; or 1 and one line on stderr if its arguments are refused.

    Errors of callbacks are the caller's.
    """
    node = None
    try:
        rclpy.init()
        node = make_node()
        rclpy.spin(node)
    except (ValueError, OSError, RCLError) as error:
        if node is None:
            print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
            return 1
        # not a refused parameter but a mistake in a callback, or one that published after a signal had ended the context
        if rclpy.ok() or not isinstance(error, RCLError):
            raise
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
