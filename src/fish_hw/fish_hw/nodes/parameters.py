"""ROS parameters to settings."""

from dataclasses import asdict
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from fish_hw.settings.checks import in_type_of


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
