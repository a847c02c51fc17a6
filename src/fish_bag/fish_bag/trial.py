# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The typed data set: what a recording becomes, numpy arrays on one time axis.

Time: every `t` is float64 seconds from `Trial.origin_ns`, the moment of measurement (header stamp, mapped
to the trial's axis if its clock is another one; arrival time for messages without a header). `t_arrival` is
the moment the recorder got the message, on the same axis. Values may be slightly negative.

Frames: "pool" is REP 103 (x along the pool, y left, z up, origin in its middle); "base_link" is the head's
centre of mass, x forward, y left, z up; "imu_link" has base_link's axes. Angles in rad, counter-clockwise
positive seen from above.

Samples stand in order of arrival and none is left out. `flags` says what is wrong with each (0 = nothing);
`Stream.clean()` and `Trial.clean()` return the unflagged samples in order of time, which is what fits need.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from fish_bag.problem import Problem
from fish_bag.time_axis import ClockEstimate

# bits of Stream.flags
DUPLICATE = 1  # the stamp repeats an earlier one
TIME_BACK = 2  # the stamp is older than one that came before
NOT_FINITE = 4  # a value that is used is NaN or infinite
WRONG_FRAME = 8  # frame_id is not the expected one
BAD_STAMP = 16  # the stamp is zero or far away from the rest of the recording
NOT_MEASURED = 128  # the message says by a covariance of -1 that it does not measure this
JUMP = 64  # a camera pose far from those before and after: lost or swapped markers
FROZEN = 256  # a gyro that gives one value while the rotor moves
UNREADABLE = 32  # the bytes cannot be decoded as the message type; values are NaN, t is the arrival


@dataclass(frozen=True, kw_only=True)
class Stream:
    """Samples of one topic: every array's first axis is N."""

    topic: str  # full name in the recording
    frame_id: str  # as recorded in the first message, "" without a header
    t: np.ndarray  # (N,) moment of measurement [s]
    t_arrival: np.ndarray  # (N,) moment of arrival [s]
    flags: np.ndarray  # (N,) uint16, bits above

    def __len__(self) -> int:
        return len(self.t)

    def take(self, index: np.ndarray) -> Self:
        """The samples at `index` (positions or boolean mask)."""
        n = len(self)
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(
            self,
            **{k: v[index] for k, v in arrays.items() if isinstance(v, np.ndarray) and len(v) == n},
        )

    def clean(self) -> Self:
        """The samples without any flag, in order of time."""
        good = np.flatnonzero(self.flags == 0)
        return self.take(good[np.argsort(self.t[good], kind="stable")])


@dataclass(frozen=True, kw_only=True)
class Commands(Stream):
    """joint_command: followed from its stamp to the next one; speed and rudder move linearly towards it."""

    rotor_phase: np.ndarray  # (N,) oscillation phase [rad]
    rotor_speed: np.ndarray  # (N,) commanded rotor speed phi_dot [rad/s]
    rudder: np.ndarray  # (N,) commanded alpha [rad]


@dataclass(frozen=True, kw_only=True)
class Encoder(Stream):
    """joint_states: the rotor as its encoder measures it."""

    angle: np.ndarray  # (N,) [rad], as recorded (wrapped or not); NaN where not given
    speed: np.ndarray  # (N,) [rad/s]


@dataclass(frozen=True, kw_only=True)
class Imu(Stream):
    """imu/data, axes of imu_link."""

    gyro: np.ndarray  # (N, 3) angular velocity [rad/s]
    accel: np.ndarray  # (N, 3) specific force, gravity included [m/s^2]
    orientation: (
        np.ndarray
    )  # (N, 4) quaternion x, y, z, w, no absolute heading; NaN where not given


@dataclass(frozen=True, kw_only=True)
class Camera(Stream):
    """camera/pose: head's centre of mass and heading, frame pool."""

    x: np.ndarray  # (N,) [m]
    y: np.ndarray  # (N,) [m]
    psi: np.ndarray  # (N,) heading in (-pi, pi] [rad]
    covariance: np.ndarray  # (N, 3, 3) of x, y, psi [m^2, m rad, rad^2]

    @property
    def pose(self) -> np.ndarray:
        """(N, 3) x, y, psi."""
        return np.column_stack([self.x, self.y, self.psi])


@dataclass(frozen=True, kw_only=True)
class Tail(Stream):
    """camera/tail: relative angles of the marked tail segments, counter-clockwise positive."""

    names: tuple[str, ...]  # n segment names, tail_1 first
    angle: np.ndarray  # (N, n) [rad]


@dataclass(frozen=True, kw_only=True)
class Odometry(Stream):
    """odometry/filtered (estimate) or sim/odometry (ground truth): pose in pool, velocity in base_link."""

    x: np.ndarray  # (N,) [m]
    y: np.ndarray  # (N,) [m]
    psi: np.ndarray  # (N,) [rad]
    u: np.ndarray  # (N,) surge speed [m/s]
    v: np.ndarray  # (N,) sway speed [m/s]
    r: np.ndarray  # (N,) yaw rate [rad/s]

    @property
    def pose(self) -> np.ndarray:
        """(N, 3) x, y, psi."""
        return np.column_stack([self.x, self.y, self.psi])


@dataclass(frozen=True, kw_only=True)
class Gains(Stream):
    """control/gains."""

    names: tuple[str, ...]  # from the message's layout
    values: np.ndarray  # (N, 6) Kp, Ki, Kd of steering, then of speed


@dataclass(frozen=True, kw_only=True)
class Target(Stream):
    """control/target: the line-of-sight lookahead point, frame pool."""

    x: np.ndarray  # (N,) [m]
    y: np.ndarray  # (N,) [m]
    course: np.ndarray  # (N,) [rad]


@dataclass(frozen=True, kw_only=True)
class TrackingError(Stream):
    """tracking/error as the controller computed it."""

    cross_track: np.ndarray  # (N,) [m], positive left of the path
    heading: np.ndarray  # (N,) [rad]
    speed: np.ndarray  # (N,) [m/s]


@dataclass(frozen=True, kw_only=True)
class Battery(Stream):
    """battery_state."""

    voltage: np.ndarray  # (N,) [V]


@dataclass(frozen=True, kw_only=True)
class ReferenceSpeed(Stream):
    """reference/speed: commanded surge speed."""

    speed: np.ndarray  # (N,) [m/s]


@dataclass(frozen=True)
class ReferencePath:
    """reference/path, frame pool; valid from t until the next one."""

    t: float  # [s]
    points: np.ndarray  # (P, 2) x, y [m], in order of travel
    frame_id: str


@dataclass(frozen=True)
class TopicSummary:
    """What was counted on one topic, mapped or not."""

    topic: str
    type: str
    count: int
    rate_hz: float  # (count - 1) / time between first and last, nan below two messages
    period_s: float  # median distance of stamps
    longest_gap_s: float
    latency_s: tuple[
        float, float, float
    ]  # arrival minus stamp: 1 %, 50 %, 99 % quantile; nan without header
    role: str  # key in the topic map, "" if the reader has no use for it
    stamped: bool  # has a header


@dataclass(frozen=True)
class Trial:
    """One recording. None: the topic is missing or not readable (and `problems` says so where it matters)."""

    name: str
    path: Path
    origin_ns: int  # time axis zero, ns since epoch, clock `axis`
    duration: float  # from first to last arrival [s]
    namespace: str  # for example "/fish"
    axis: str  # name of the clock the axis belongs to
    commands: Commands | None = None
    encoder: Encoder | None = None
    imu: Imu | None = None
    camera: Camera | None = None
    tail: Tail | None = None
    odometry: Odometry | None = None  # the robot's own estimate
    truth: Odometry | None = None  # simulator only
    gains: Gains | None = None
    target: Target | None = None
    tracking_error: TrackingError | None = None
    battery: Battery | None = None
    reference_speed: ReferenceSpeed | None = None
    reference_paths: tuple[ReferencePath, ...] = ()
    clocks: tuple[ClockEstimate, ...] = ()
    topics: tuple[TopicSummary, ...] = ()
    problems: tuple[Problem, ...] = ()
    metadata: dict[str, str] = field(
        default_factory=dict
    )  # custom data of the recording, "robot" among them

    @property
    def streams(self) -> dict[str, Stream]:
        """Field name -> stream, of those that are there."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: value for name, value in found.items() if isinstance(value, Stream)}

    @property
    def reference_path(self) -> np.ndarray | None:
        """(P, 2) points of the last reference path [m], frame pool."""
        return self.reference_paths[-1].points if self.reference_paths else None

    def clean(self) -> Trial:
        """The same trial without flagged samples, streams in order of time; empty streams become None."""
        cleaned = {name: stream.clean() for name, stream in self.streams.items()}
        kept: dict[str, Any] = {
            name: stream if len(stream) else None for name, stream in cleaned.items()
        }
        return replace(self, **kept)


@dataclass(frozen=True)
class DataSet:
    """Trials of the same robot in the same pool and day."""

    name: str
    path: Path
    trials: tuple[Trial, ...]
    problems: tuple[Problem, ...] = ()  # of the set; those of a trial stand with the trial

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[Trial]:
        return iter(self.trials)

    def __getitem__(self, name: str) -> Trial:
        for trial in self.trials:
            if trial.name == name:
                return trial
        raise KeyError(
            f"no trial {name!r} in {self.name}; known: {', '.join(t.name for t in self.trials)}"
        )

    def clean(self) -> DataSet:
        """The same set with every trial cleaned."""
        return replace(self, trials=tuple(trial.clean() for trial in self.trials))
