# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which topic plays which role, on which clock and in which frame: the default names, or a YAML file.

The namespace that the topics stand in says which robot a recording is of.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fish_bag.decode import PATH_ROLE, PATH_TYPE, ROLES
from fish_bag.problem import RecordingError
from fish_report.errors import user_errors
from fish_report.files import read_yaml

TIMES = ("stamp", "arrival")
KNOWN_ROLES = (*ROLES, PATH_ROLE)
KEYS = {"namespace": str, "max_latency_s": (int, float), "topics": dict}  # of the YAML file
RULE_KEYS = {
    "topic": str,
    "time": str,
    "clock": str,
    "frame": str,
    "required": bool,
}  # of one role in it
KIND_NAMES = {str: "text", (int, float): "a number", dict: "a mapping", bool: "true or false"}
SIGNS_OF_A_ROBOT = (
    "commands",
    "imu",
)  # two namespaces with one of these are two robots; sim/joint_states is none


@dataclass(frozen=True)
class TopicRule:
    """How one topic is read."""

    topic: str  # relative to the robot's namespace, or absolute with a leading /
    time: str = (
        "stamp"  # "stamp": header stamp is the moment of measurement; "arrival": the bag's own time
    )
    clock: str = "robot"  # machine whose clock made the stamps
    frame: str = ""  # expected frame_id, "" for any
    required: bool = False  # a trial without it is of no use for identification

    def __post_init__(self) -> None:
        if not self.topic:
            raise RecordingError("topic map: an empty topic name")
        if self.time not in TIMES:
            raise RecordingError(
                f"topic map: {self.topic}: time {self.time!r}; expected {' or '.join(TIMES)}"
            )


DEFAULT_RULES = {
    "commands": TopicRule("joint_command", required=True),
    "encoder": TopicRule("joint_states"),
    "imu": TopicRule("imu/data", frame="imu_link"),
    "camera": TopicRule("camera/pose", clock="camera", frame="pool", required=True),
    "tail": TopicRule("camera/tail", clock="camera"),
    "odometry": TopicRule("odometry/filtered", frame="pool"),
    "truth": TopicRule("sim/odometry", frame="pool"),
    "gains": TopicRule("control/gains", time="arrival"),
    "target": TopicRule("control/target", frame="pool"),
    "tracking_error": TopicRule("tracking/error"),
    "battery": TopicRule("battery_state"),
    "reference_speed": TopicRule("reference/speed", time="arrival"),
    PATH_ROLE: TopicRule("reference/path", time="arrival", frame="pool"),
}


@dataclass(frozen=True)
class TopicMap:
    """Rules by role (keys of decode.ROLES and "reference_paths")."""

    rules: dict[str, TopicRule] = field(default_factory=lambda: dict(DEFAULT_RULES))
    namespace: str | None = None  # robot's namespace; None: found from the topics
    max_latency_s: float = (
        0.5  # stamps older than this at arrival, or in the future, are another clock's
    )

    def __post_init__(self) -> None:
        for role in self.rules:
            if role not in KNOWN_ROLES:
                raise RecordingError(
                    f"topic map: unknown role {role!r}; known: {', '.join(KNOWN_ROLES)}"
                )
        if not self.max_latency_s > 0:
            raise RecordingError(f"topic map: max_latency_s {self.max_latency_s}; expected > 0")


def load_topic_map(path: Path) -> TopicMap:
    """Read a YAML map; roles it does not name keep their defaults, a role set to null is not read.

    Raises:
        RecordingError: the file or a rule is not as expected.
    """
    try:
        data = read_yaml(path)
    except ValueError as error:
        raise RecordingError(f"{path}: topic map {error}") from error
    data = _checked(f"{path}: topic map", {} if data is None else data, KEYS)
    rules = dict(DEFAULT_RULES)
    for role, given in data.pop("topics", {}).items():
        where = f"{path}: role {role}"
        if given is None:
            rules.pop(role, None)
        elif role in DEFAULT_RULES:
            named = {"topic": given} if isinstance(given, str) else given
            rules[role] = replace(DEFAULT_RULES[role], **_checked(where, named, RULE_KEYS))
        else:
            raise RecordingError(f"{where}: unknown; known: {', '.join(KNOWN_ROLES)}")
    return TopicMap(rules, **data)


def _checked(where: str, given: object, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """The mapping without what is null, if it has these keys with values of these kinds only."""
    if not isinstance(given, dict) or not set(given) <= set(kinds):
        raise RecordingError(
            f"{where}: got {given!r}; expected a mapping with keys {', '.join(kinds)}"
        )
    values = {key: value for key, value in given.items() if value is not None}
    for key, value in values.items():
        if not isinstance(value, kinds[key]):
            raise RecordingError(f"{where}: got {key} {value!r}; expected {KIND_NAMES[kinds[key]]}")
    return values


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


def add_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --topics and --namespace."""
    parser.add_argument(
        "--topics", type=Path, help="YAML topic map (default: the names of the format)"
    )
    parser.add_argument("--namespace", help="robot's namespace (default: found from the topics)")


def topic_map(args: argparse.Namespace) -> TopicMap:
    """The topic map that these arguments give.

    Raises:
        UserError: the file is no topic map.
    """
    with user_errors():
        topics = load_topic_map(args.topics) if args.topics else TopicMap()
    return topics if args.namespace is None else replace(topics, namespace=args.namespace)
