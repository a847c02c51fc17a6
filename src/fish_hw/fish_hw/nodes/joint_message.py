# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reads one joint out of a JointState."""

from sensor_msgs.msg import JointState


def joint_value(message: JointState, name: str, field: str) -> float | None:
    """message.<field> of the joint `name`; None if the joint is absent or has no such value."""
    values = getattr(message, field)
    if name not in message.name:
        return None
    index = message.name.index(name)
    return float(values[index]) if index < len(values) else None
