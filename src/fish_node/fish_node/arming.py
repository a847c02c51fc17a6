# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the motors may move: disarmed at the start, armed by a person, disarmed by any trouble and then latched.

Disarmed is the state that nothing but `arm` ends: neither a fresh command nor a device that is back. No ROS and no
clock of its own; times are in s of one clock that is never set.

A trouble disarms when it has lasted for its source's `patience_s`. Most have none. A doubt about the estimate, and a node that
pauses its commands, are borne for `pause_s`, so that one late message needs no person.

Texts of other nodes are made harmless before they are logged or published again.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable
from dataclasses import dataclass

from fish_node.pool import FARTHEST

LONGEST = 400  # characters
FASTEST = 50.0  # m/s, rad/s
LEAST_NORM = 0.5  # of an orientation's part about z


def visible(text: str) -> str:
    """The first LONGEST characters of a text; those that a terminal obeys or hides become their escapes."""
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode()
        for char in text[:LONGEST]
    )


ESTIMATES = ("required", "watched", "ignored")
AT_START = "not armed since the start"


@dataclass(frozen=True)
class ArmingSettings:
    """Parameters of the node that owns the arming state.

    estimate: "required" refuses to arm without odometry and camera poses, "watched" disarms when they cease to come,
    "ignored" does not look at them (tests on the bench).
    """

    estimate: str = "required"  # required | watched | ignored: odometry/filtered and camera/pose
    odometry_timeout_s: float = 0.2  # s without new odometry/filtered until the robot is disarmed
    camera_timeout_s: float = 0.2  # s without a new camera/pose until the robot is disarmed
    pause_s: float = (
        0.06  # s that a pause of the controller, or a doubt of fusion, may last until then
    )
    largest_variance: float = 1.0  # m^2, rad^2 and their rates; fusion marks what it lost with 1e4
    deadman_timeout_s: float = 0.0  # s without `true` on operator/deadman; 0: no deadman is used

    def __post_init__(self) -> None:
        if self.estimate not in ESTIMATES:
            raise ValueError(f"estimate is {self.estimate!r}, expected one of {ESTIMATES}")
        for name, low, high in (
            ("odometry_timeout_s", 0.02, 5.0),
            ("camera_timeout_s", 0.05, 5.0),
            ("pause_s", 0.0, 5.0),
            ("largest_variance", 1e-6, 1e3),
            ("deadman_timeout_s", 0.0, 5.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} is {value}, expected {low:g} to {high:g}")


@dataclass(frozen=True)
class Source:
    """Something that must be well, and must go on coming, while the robot is armed.

    Attributes:
        name: what it is in messages, such as joint_command.
        timeout_s: silence [s] that disarms; infinite where silence is no trouble.
        required: whether the robot can be armed without having heard it.
        patience_s: how long [s] its trouble may last until it disarms.
        forgotten_s: a trouble that was not repeated for so long [s] does not count when the robot is armed.
    """

    name: str
    timeout_s: float = math.inf
    required: bool = True
    patience_s: float = 0.0
    forgotten_s: float = math.inf


@dataclass
class _Heard:
    """The newest word of a source, and since when it has been in trouble."""

    time_s: float | None = None
    trouble: str = ""
    since_s: float = 0.0


class Arming:
    """The arming state of one robot; methods may be called from several threads.

    Attributes:
        reason: why the robot is disarmed; empty while it is armed.
        count: how often it was armed.
    """

    def __init__(self, sources: Iterable[Source] = ()) -> None:
        self.reason = AT_START
        self.count = 0
        self._armed = False
        self._sources = {source.name: source for source in sources}
        self._heard = {name: _Heard() for name in self._sources}
        self._lock = threading.RLock()

    @property
    def armed(self) -> bool:
        """Whether the motors may move, as of the last check."""
        return self._armed

    def heard(self, name: str, now: float, trouble: str = "") -> None:
        """Note that a source spoke at `now` [s], and what its trouble is; an unknown name has no timeout.

        A silence or a trouble that this word ends disarms, though no check came in between, as in a process that stood still.
        """
        with self._lock:
            if name not in self._sources:
                self._sources[name] = Source(name, required=False)
                self._heard[name] = _Heard()
            heard = self._heard[name]
            if self._armed and (ended := self._trouble(self._sources[name], now, patient=True)):
                self.disarm(ended)
            if not heard.trouble:
                heard.since_s = now
            heard.time_s, heard.trouble = now, visible(trouble) if trouble else ""

    def troubles(self, now: float, patient: bool = False) -> list[str]:
        """Everything that forbids to move at `now` [s], in words; patient: without what may last a little longer."""
        with self._lock:
            found = [self._trouble(source, now, patient) for source in self._sources.values()]
        return [trouble for trouble in found if trouble]

    def arm(self, now: float) -> str:
        """Arm; the reason why not, or an empty text."""
        with self._lock:
            self._forget_silent(now)
            if troubles := self.troubles(now):
                return "; ".join(troubles)
            if not self._armed:
                self._armed, self.reason = True, ""
                self.count += 1
            return ""

    def disarm(self, reason: str) -> None:
        """Disarm until `arm`; the first reason of a stop is kept."""
        with self._lock:
            if self._armed:
                self._armed, self.reason = False, visible(reason)

    def check(self, now: float) -> bool:
        """Whether the motors may move at `now` [s]; disarms at the first trouble."""
        with self._lock:
            if self._armed and (troubles := self.troubles(now, patient=True)):
                self.disarm("; ".join(troubles))
            return self._armed

    def state(self, now: float) -> tuple[bool, str, int]:
        """`armed`, `reason` and `count` at one moment, after a check at `now` [s]."""
        with self._lock:
            return self.check(now), self.reason, self.count

    def _forget_silent(self, now: float) -> None:
        """What is not required and fell silent is not waited for."""
        for name, source in self._sources.items():
            heard = self._heard[name]
            limit_s = source.forgotten_s if heard.trouble else source.timeout_s
            if not source.required and heard.time_s is not None and now - heard.time_s > limit_s:
                self._heard[name] = _Heard()

    def _trouble(self, source: Source, now: float, patient: bool) -> str:
        heard = self._heard[source.name]
        if heard.time_s is None:
            return f"no {source.name} yet" if source.required else ""
        if heard.trouble:
            bearable = patient and now - heard.since_s < source.patience_s
            return "" if bearable else heard.trouble
        if now - heard.time_s > source.timeout_s:
            return f"no {source.name} for {source.timeout_s:g} s"
        return ""


ODOMETRY, CAMERA, DEADMAN, ESTOP, PAUSE, OWNER = (
    "odometry/filtered",
    "camera/pose",
    "operator/deadman",
    "operator/estop",
    "arming/pause",
    "arming/state",
)
PAUSE_FORGOTTEN_S = 1.0  # s; a node that pauses repeats it more often, another owner as well


def operator_and_estimate(settings: ArmingSettings) -> tuple[Source, ...]:
    """The sources that every owner of the arming state has: pauses, other owners, the estimate, a deadman if one is used."""
    pause = Source(
        PAUSE, required=False, patience_s=settings.pause_s, forgotten_s=PAUSE_FORGOTTEN_S
    )
    sources = [pause, Source(OWNER, required=False, forgotten_s=PAUSE_FORGOTTEN_S)]
    if settings.estimate != "ignored":
        required = settings.estimate == "required"
        sources += [
            Source(ODOMETRY, settings.odometry_timeout_s, required, settings.pause_s),
            Source(CAMERA, settings.camera_timeout_s, required),
        ]
    if settings.deadman_timeout_s > 0.0:
        sources.append(Source(DEADMAN, settings.deadman_timeout_s))
    return tuple(sources)


def largest_of(variances: Iterable[float]) -> float:
    """The largest variance; NaN if one is no number or below zero, which says that nobody measured it."""
    found = list(variances)
    return max(found) if all(value >= 0.0 for value in found) else math.nan


def can_be_in_a_pool(x: float, y: float, qz: float, qw: float) -> bool:
    """Whether a place [m] and the part of an orientation about z are numbers that a fish in a pool can have."""
    near = abs(x) <= FARTHEST and abs(y) <= FARTHEST
    return near and LEAST_NORM <= math.hypot(qz, qw) <= 1.0 / LEAST_NORM


def can_be_swum(rates: Iterable[float]) -> bool:
    """Whether velocities [m/s, rad/s] are numbers that a fish can have."""
    return all(abs(rate) <= FASTEST for rate in rates)


def estimate_trouble(
    pose_variance: float, twist_variance: float, plausible: bool, largest_variance: float
) -> str:
    """What is wrong with an estimate of the motion; empty if nothing is.

    The variances are the largest of the pose [m^2, rad^2] and of the velocity [m^2/s^2, rad^2/s^2]; one that is no number
    is too large.
    """
    if not plausible:
        return "odometry/filtered is not plausible: a value is not a number, or no fish can have it"
    if not pose_variance <= largest_variance:
        return "camera lost: fusion does not vouch for the pose"
    if not twist_variance <= largest_variance:
        return "IMU lost: fusion does not vouch for the velocity"
    return ""
