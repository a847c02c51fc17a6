# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameter descriptors from a dataclass: what `ros2 param describe` shows."""

import math
import sys
from collections.abc import Collection
from dataclasses import asdict
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from fish_node.parameter_docs import ParameterDoc, parameter_docs

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
