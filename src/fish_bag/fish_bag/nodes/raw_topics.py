# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What recorder and replayer share: message classes by name, and quality of service to and from rclpy."""

from __future__ import annotations

from importlib import import_module

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from fish_bag.bag_metadata import Qos
from fish_bag.problem import RecordingError


def message_class(msgtype: str) -> type:
    """The class of "package/msg/Name".

    Raises:
        RecordingError: its package is not installed here.
    """
    try:
        package, folder, name = msgtype.split("/")
        found: type = getattr(import_module(f"{package}.{folder}"), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise RecordingError(f"message type {msgtype} is not installed here: {error}") from error
    return found


def from_profile(profile: QoSProfile) -> Qos:
    """The policies that recordings keep."""
    return Qos(
        reliable=profile.reliability != ReliabilityPolicy.BEST_EFFORT,
        transient_local=profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        depth=max(1, profile.depth),
    )


def to_profile(qos: Qos) -> QoSProfile:
    """An rclpy profile with these policies."""
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if qos.transient_local
        else DurabilityPolicy.VOLATILE,
    )
