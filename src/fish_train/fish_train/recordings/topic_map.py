"""Which topic plays which role, on which clock and in which frame: the default names, or a YAML file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from .decode import PATH_ROLE, ROLES
from .problem import RecordingError

TIMES = ("stamp", "arrival")


@dataclass(frozen=True)
class TopicRule:
    """How one topic is read."""

    topic: str  # relative to the robot's namespace, or absolute with a leading /
    time: str = "stamp"  # "stamp": header stamp is the moment of measurement; "arrival": the bag's own time
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
    max_latency_s: float = 0.5  # stamps older than this at arrival, or in the future, are another clock's

    def __post_init__(self) -> None:
        known = [*ROLES, PATH_ROLE]
        for role in self.rules:
            if role not in known:
                raise RecordingError(f"topic map: unknown role {role!r}; known: {', '.join(known)}")
        if not self.max_latency_s > 0:
            raise RecordingError(f"topic map: max_latency_s {self.max_latency_s}; expected > 0")

    def as_dict(self) -> dict[str, Any]:
        """What stands in the YAML file."""
        rules = {role: asdict(rule) for role, rule in self.rules.items()}
        return {"namespace": self.namespace, "max_latency_s": self.max_latency_s, "topics": rules}


def load_topic_map(path: Path) -> TopicMap:
    """Read a YAML map; roles it does not name keep their defaults, a role set to null is not read.

    Raises:
        RecordingError: the file or a rule is not as expected.
    """
    try:
        data = yaml.safe_load(path.read_text()) or {}
    except (OSError, yaml.YAMLError) as error:
        raise RecordingError(f"{path}: topic map cannot be read: {error}") from error
    unknown = (
        set(data) - {"namespace", "max_latency_s", "topics"} if isinstance(data, dict) else {"(no mapping)"}
    )
    if unknown:
        raise RecordingError(
            f"{path}: unknown keys {sorted(unknown)}; known: namespace, max_latency_s, topics"
        )
    rules = dict(DEFAULT_RULES)
    for role, given in (data.get("topics") or {}).items():
        if given is None:
            rules.pop(role, None)
        else:
            rules[role] = _rule(path, role, given)
    return TopicMap(rules, data.get("namespace"), float(data.get("max_latency_s", 0.5)))


def _rule(path: Path, role: str, given: object) -> TopicRule:
    """One rule; a bare string is the topic's name."""
    default = DEFAULT_RULES.get(role)
    values = asdict(default) if default else {}
    given = {"topic": given} if isinstance(given, str) else given
    known = [f.name for f in fields(TopicRule)]
    if not isinstance(given, dict) or not set(given) <= set(known):
        raise RecordingError(
            f"{path}: role {role}: got {given!r}; expected a topic name or keys {', '.join(known)}"
        )
    return TopicRule(**(values | given))
