"""ROS parameters to settings."""

from dataclasses import asdict
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node


def read_settings(node: Node, settings_class: type[Any]) -> Any:
    """Declare every field as a parameter and make the settings of what is set.

    Raises:
        ValueError: wrong type or value; names the parameter, what came and what was expected.
    """
    values = {}
    for name, default in asdict(settings_class()).items():
        descriptor = ParameterDescriptor(dynamic_typing=True)
        values[name] = in_type_of(default, node.declare_parameter(name, default, descriptor).value, name)
    return settings_class(**values)


def in_type_of(default: Any, value: Any, name: str) -> Any:
    """value, of the same type as default; a whole number may stand for a float (rate_hz:=100)."""
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(value) is not type(default):
        raise ValueError(f"{name} is {value!r}, expected {type(default).__name__} such as {default!r}")
    return value
