"""ROS parameters to settings."""

from dataclasses import asdict
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from fish_hw.settings.checks import in_type_of, unknown_names


def read_settings(node: Node, settings_class: type[Any]) -> Any:
    """Declare every field as a parameter and make the settings of what is set.

    The node must have been made with automatically_declare_parameters_from_overrides.

    Raises:
        ValueError: unknown name, wrong type or value; names the parameter, what came and what was expected.
    """
    defaults = asdict(settings_class())
    if unknown := unknown_names(node.get_parameters_by_prefix(""), defaults):
        raise ValueError(unknown)
    values = {}
    for name, default in defaults.items():
        if node.has_parameter(name):  # declared with the type that came, which may not be the right one
            node.undeclare_parameter(name)
        descriptor = ParameterDescriptor(dynamic_typing=True)
        values[name] = in_type_of(default, node.declare_parameter(name, default, descriptor).value, name)
    return settings_class(**values)
