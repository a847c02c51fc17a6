# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters that a node takes over at run time: checked as a whole first, then taken over, or refused with the reason."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Generic, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from fish_node.parameters import in_type_of

Config = TypeVar("Config")
Prepare = Callable[[Config, Config], Callable[[], None]]


class Changes(Generic[Config]):
    """Watches a node's settable parameters.

    Args:
        node: has declared its parameters with read_parameters.
        config: what they are now.
        prepare: takes the settings before and after a change; raises ValueError to refuse it, and otherwise returns what
            takes it over. Nothing may change before that is called.
    """

    def __init__(self, node: Node, config: Config, prepare: Prepare[Config]) -> None:
        self.config = config
        self._prepare = prepare
        self._defaults = asdict(config)  # type: ignore[call-overload]
        self._next: tuple[Config, Callable[[], None]] | None = None
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take_over)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        self._next = None
        try:
            values = {
                p.name: in_type_of(p.name, p.value, self._defaults[p.name])
                for p in parameters
                if p.name in self._defaults
            }
            if values:
                after = replace(self.config, **values)  # type: ignore[type-var]
                self._next = after, self._prepare(self.config, after)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=" ".join(str(error).split()))
        return SetParametersResult(successful=True)

    def _take_over(self, _: list[Parameter]) -> None:
        if self._next is not None:
            self.config, take_over = self._next
            self._next = None
            take_over()
