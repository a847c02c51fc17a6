# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node: how they are described, and how they change while it runs."""

import math
import sys
from collections.abc import Callable, Collection
from dataclasses import asdict, replace
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from fish_node.parameters import ParameterDoc, in_type_of, parameter_docs

LARGEST_INTEGER = 2**63 - 1


def descriptors(config: Any, settable: Collection[str] = ()) -> dict[str, ParameterDescriptor]:
    """One descriptor for each field, with description, constraints in words, and the range of a number.

    Args:
        config: dataclass of parameters.
        settable: names of those that are not read-only.
    """
    values = asdict(config)
    return {
        name: _descriptor(name, doc, values[name], name not in settable)
        for name, doc in parameter_docs(config).items()
    }


def _descriptor(name: str, doc: ParameterDoc, like: object, read_only: bool) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(name=name, description=doc.description, read_only=read_only)
    descriptor.additional_constraints = doc.allowed
    if doc.interval is None:
        return descriptor
    low, high = doc.interval
    if isinstance(like, float):
        top = sys.float_info.max if math.isinf(high) else high
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=top)]
    elif isinstance(like, int) and not isinstance(like, bool):
        last = LARGEST_INTEGER if math.isinf(high) else int(high)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=last)]
    return descriptor


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
