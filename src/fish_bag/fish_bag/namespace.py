# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which robot a recording is of: the namespace its topics stand in."""

from __future__ import annotations

from collections.abc import Iterable

from fish_bag.decode import PATH_ROLE, PATH_TYPE, ROLES
from fish_bag.problem import RecordingError
from fish_bag.topic_map import DEFAULT_RULES, TopicMap

SIGNS_OF_A_ROBOT = (
    "commands",
    "imu",
)  # two namespaces with one of these are two robots; sim/joint_states is none


def full_name(namespace: str, topic: str) -> str:
    """Absolute topic name."""
    return topic if topic.startswith("/") else f"{namespace.rstrip('/')}/{topic}"


def message_types(namespace: str) -> dict[str, str]:
    """Message type of each default topic of the robot in `namespace`, by the topic's full name."""
    return {
        full_name(namespace, rule.topic): PATH_TYPE if role == PATH_ROLE else ROLES[role].type
        for role, rule in DEFAULT_RULES.items()
    }


def find_namespace(recorded: Iterable[str], topics: TopicMap) -> str:
    """The namespace that holds most of the mapped topics, "" for the root.

    Raises:
        RecordingError: topics of more than one robot are in it.
    """
    roles: dict[str, set[str]] = {}
    for topic in recorded:
        for role, rule in topics.rules.items():
            if not rule.topic.startswith("/") and topic.endswith(f"/{rule.topic}"):
                roles.setdefault(topic[: -len(rule.topic) - 1], set()).add(role)
    robots = sorted(ns for ns, found in roles.items() if found & set(SIGNS_OF_A_ROBOT))
    if len(robots) > 1:
        raise RecordingError(
            f"the recording holds {len(robots)} robots ({', '.join(ns or '/' for ns in robots)}); "
            "say which one with --namespace or 'namespace:' in the topic map"
        )
    if robots:
        return robots[0]
    return max(sorted(roles), key=lambda ns: len(roles[ns] & set(ROLES)), default="")
