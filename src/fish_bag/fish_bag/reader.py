# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One recording in, one typed trial out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fish_bag import checks
from fish_bag.bag import (
    RawBag,
    RawTopic,
    is_pool_bag,
    read_bag,
)
from fish_bag.checks import check_publishers
from fish_bag.decode import NOT_MEASURED, PATH_ROLE, PATH_TYPE, ROLES
from fish_bag.message_types import types_of, typestore
from fish_bag.problem import Problem, RecordingError
from fish_bag.sensor_checks import check_sensors, flag_frozen
from fish_bag.streams import (
    Decoded,
    decode_paths,
    decode_topic,
    stamps_of_prefixes,
    summarise,
)
from fish_bag.time_axis import (
    MASTER,
    Stamps,
    TimeAxis,
    build_axis,
    clocks_apart,
)
from fish_bag.topic_map import TopicMap, TopicRule, find_namespace, full_name
from fish_bag.trial import (
    ReferencePath,
    Stream,
    TopicSummary,
    Trial,
)

MEASURED = ("commands", "encoder", "imu", "camera", "tail")  # roles with a steady rate
KNOWN = ("cdr", "ros1")  # serialisations that are decoded
LONGEST_NS = 30 * 24 * 3600 * 10**9  # of a recording; arrivals farther from the median are wrong


def read_trial(path: Path | str, topics: TopicMap | None = None) -> Trial:
    """Read one recording into a typed trial.

    Args:
        path: rosbag2 directory (MCAP or sqlite3), bare .mcap or .db3 file, or ROS 1 .bag file.
        topics: which topic is what; None: the default names (config/topics.yaml).

    Raises:
        RecordingError: nothing can be read; everything less stands in Trial.problems.
    """
    topics, path = topics or TopicMap(), Path(path)
    last_names = {rule.topic.rsplit("/", 1)[-1] for rule in topics.rules.values()}
    bag = read_bag(path, lambda topic, _: topic.rsplit("/", 1)[-1] in last_names)
    return _Assembly(bag, topics).trial()


def _has_role(raw: RawTopic, topics: TopicMap) -> bool:
    """Whether a topic is, by its name, type and serialisation, one of a robot's in any namespace."""
    return raw.stored.serialization in KNOWN and any(
        f"/{raw.topic}".endswith(f"/{rule.topic.lstrip('/')}")
        and raw.type == (PATH_TYPE if role == PATH_ROLE else ROLES[role].type)
        for role, rule in topics.rules.items()
    )


def _serialization(raw: RawTopic) -> Problem:
    text = f"{len(raw.raws)} messages serialised as {raw.stored.serialization!r}; expected cdr"
    return Problem("error", "serialization", raw.topic, text, len(raw.raws))


@dataclass(frozen=True)
class _Mapped:
    """One role's topic, decoded."""

    rule: TopicRule
    decoded: Decoded
    stamps: Stamps | None  # None: measured at arrival


class _Assembly:
    """Builds the trial of one raw bag step by step; every step may add problems."""

    def __init__(self, bag: RawBag, topics: TopicMap) -> None:
        self.bag, self.topics = bag, topics
        self.problems = [Problem("warning", "storage", "", note) for note in bag.notes]
        names = [raw.topic for raw in bag.topics]
        fitting = [raw.topic for raw in bag.topics if _has_role(raw, topics)]
        try:
            found = topics.namespace
            self.namespace = find_namespace(fitting or names, topics) if found is None else found
        except RecordingError as error:
            raise RecordingError(f"{bag.path}: {error}") from error
        truth = topics.rules.get("truth")  # where a simulator speaks, all stamps are of its clock
        self.simulated = truth is not None and full_name(self.namespace, truth.topic) in names

    def trial(self) -> Trial:
        mapped = self.decode()
        if not mapped and self.topic_of(PATH_ROLE) is None:
            held = ", ".join(sorted(f"{raw.topic} ({raw.type})" for raw in self.bag.topics))
            advice = "; 'robofish import_pool' converts it" if is_pool_bag(self.bag) else ""
            raise RecordingError(
                f"{self.bag.path}: none of the robot's topics can be read; it holds {held}{advice}"
            )
        arrivals = self.arrivals()
        mapped = self.separated(mapped)
        stamps = [m.stamps for m in mapped.values() if m.stamps is not None]
        axis = build_axis(stamps, int(arrivals.min()), self.topics.max_latency_s)
        self.clocks = {
            m.decoded.topic: m.stamps.clock for m in mapped.values() if m.stamps is not None
        }
        streams: dict[str, Any] = {role: self.stream(role, m, axis) for role, m in mapped.items()}
        paths = self.paths(axis)
        for clock in axis.clocks.values():
            self.problems += checks.check_clock(clock)
        self.problems += checks.check_excitation(streams.get("commands"))
        self.problems += checks.check_rotor_sign(streams.get("commands"), streams.get("encoder"))
        ends = axis.arrived(np.array([arrivals.min(), arrivals.max()]))
        trial = Trial(
            name=self.bag.path.stem if self.bag.path.is_file() else self.bag.path.name,
            path=self.bag.path,
            origin_ns=axis.origin_ns,
            duration=float(ends[1] - ends[0]),
            namespace=self.namespace,
            axis=axis.clock,
            reference_paths=paths,
            clocks=tuple(axis.clocks.values()),
            topics=tuple(self.summary(raw, axis) for raw in self.bag.topics if raw.raws),
            metadata=self.bag.metadata,
            **streams,
        )
        trial, frozen = flag_frozen(trial)
        problems = [*self.problems, *frozen, *self.foreign_topics(), *check_sensors(trial)]
        return replace(trial, problems=tuple(sorted(problems, key=checks.by_severity)))

    def foreign_topics(self) -> Iterator[Problem]:
        """A note on every topic that cannot be decoded and need not be."""
        known = {full_name(self.namespace, rule.topic) for rule in self.topics.rules.values()}
        for raw in self.bag.topics:
            usual = raw.stored.serialization in KNOWN
            if raw.topic in known or (usual and raw.type in typestore(raw.ros1).fielddefs):
                continue
            kind = f"{raw.type or 'an unknown type'} ({raw.stored.serialization or 'no encoding'})"
            text = f"{len(raw.raws)} messages of {kind} are counted, not decoded"
            yield Problem("info", "foreign_topic", raw.topic, text, len(raw.raws))

    def topic_of(self, role: str) -> RawTopic | None:
        """The recorded topic of a role, None if it is missing or of another type (both are said)."""
        rule = self.topics.rules.get(role)
        if rule is None:
            return None
        name = full_name(self.namespace, rule.topic)
        expected = PATH_TYPE if role == PATH_ROLE else ROLES[role].type
        there = [raw for raw in self.bag.topics if raw.topic == name and raw.raws]
        for raw in there:
            if raw.type != expected:
                kind = raw.type or "that the file does not say"
                text = f"{len(raw.raws)} messages of type {kind}, expected {expected}"
                self.problems.append(Problem("error", "wrong_type", name, text, len(raw.raws)))
        if not there:
            self.problems += checks.missing(role, name, rule.required)
        fitting = [raw for raw in there if raw.type == expected]
        known = [raw for raw in fitting if raw.stored.serialization in KNOWN]
        for raw in fitting if known else ():
            if raw not in known:
                self.problems.append(_serialization(raw))
        return next(iter(known or fitting), None)

    def arrivals(self) -> np.ndarray:
        """(N,) plausible times of arrival of the topics that have a role, or of all topics; int64 ns."""
        names = {full_name(self.namespace, rule.topic) for rule in self.topics.rules.values()}
        mapped = [raw.arrival_ns for raw in self.bag.topics if raw.topic in names and raw.raws]
        arrivals = np.concatenate(mapped or [raw.arrival_ns for raw in self.bag.topics])
        plausible = np.abs(arrivals - np.median(arrivals)) < LONGEST_NS
        return np.asarray(arrivals[plausible] if plausible.any() else arrivals)

    def decode(self) -> dict[str, _Mapped]:
        mapped = {}
        for role, rule in self.topics.rules.items():
            raw = None if role == PATH_ROLE else self.topic_of(role)
            if raw is not None:
                self.check_definition(raw)
                decoded = decode_topic(raw, ROLES[role])
                if decoded.arrays:
                    mapped[role] = _Mapped(rule, decoded, self.stamps(rule, decoded))
                else:
                    text = f"none of {len(raw.raws)} messages can be decoded as {raw.type}"
                    self.problems.append(
                        Problem("error", "unreadable", raw.topic, text, len(raw.raws))
                    )
        return mapped

    def check_definition(self, raw: RawTopic) -> None:
        """Say what is wrong with the recorded definition of a topic's type, or with its serialisation."""
        wrong = types_of(raw.stored)[1]
        if wrong:
            text = f"{raw.type}: {wrong}; the usual definition of that name is used"
            self.problems.append(Problem("warning", "definition", raw.topic, text))
        if raw.stored.serialization not in KNOWN:
            self.problems.append(_serialization(raw))

    def stamps(self, rule: TopicRule, decoded: Decoded) -> Stamps | None:
        """Stamps to go by; None where the map says arrival, there is no header, or stamps were never set."""
        if rule.time == "arrival" or decoded.stamp_ns is None:
            return None
        if len(decoded.stamp_ns) > 2 and not np.ptp(decoded.stamp_ns):
            text = f"all {len(decoded.stamp_ns)} stamps are the same; times of arrival are used"
            self.problems.append(Problem("warning", "no_stamps", decoded.topic, text))
            return None
        clock = MASTER if self.simulated else rule.clock
        return Stamps(
            decoded.topic, clock, decoded.stamp_ns, decoded.arrival_ns, steady=not self.simulated
        )

    def separated(self, mapped: dict[str, _Mapped]) -> dict[str, _Mapped]:
        """The same with a clock of its own for each topic whose stamps do not fit the others of its clock (said)."""
        stamps = [m.stamps for m in mapped.values() if m.stamps is not None]
        out = dict(mapped)
        for topic, ahead in clocks_apart(stamps).items():
            role, one = next((r, m) for r, m in mapped.items() if m.decoded.topic == topic)
            assert one.stamps is not None
            text = (
                f"stamps are {ahead:+.3f} s from those of the other topics of clock {one.stamps.clock!r}; they are taken for"
                " those of another clock and moved by an estimate: correct them where they are published"
            )
            self.problems.append(Problem("warning", "clock_apart", topic, text))
            out[role] = replace(
                one, stamps=replace(one.stamps, clock=f"{one.stamps.clock} of {topic}")
            )
        return out

    def stream(self, role: str, mapped: _Mapped, axis: TimeAxis) -> Stream:
        decoded, rule, stamps = mapped.decoded, mapped.rule, mapped.stamps
        t_arrival = axis.arrived(decoded.arrival_ns)
        t = t_arrival if stamps is None else axis.measured(stamps.clock, stamps.stamp_ns)
        plausible = np.ones(len(t), bool) if stamps is None else stamps.plausible
        flags = checks.flag_samples(role, decoded, rule, t, plausible, stamps is not None)
        frame = "" if decoded.frames is None else str(decoded.frames[0])
        values: dict[str, Any] = {k: v for k, v in decoded.arrays.items() if k != NOT_MEASURED}
        if ROLES[role].names:
            values["names"] = decoded.names
        values |= {
            "topic": decoded.topic,
            "frame_id": frame,
            "t": t,
            "t_arrival": t_arrival,
            "flags": flags,
        }
        stream = ROLES[role].stream(**values)
        self.problems += checks.check_stream(stream, rule, decoded.frames)
        self.problems += checks.check_joints(role, decoded, rule)
        if role in MEASURED:
            self.problems += check_publishers(stream)
        return stream

    def paths(self, axis: TimeAxis) -> tuple[ReferencePath, ...]:
        raw = self.topic_of(PATH_ROLE)
        if raw is None:
            return ()
        expected, times = self.topics.rules[PATH_ROLE].frame, axis.arrived(raw.arrival_ns)
        paths = []
        for t, path in zip(times.tolist(), decode_paths(raw), strict=True):
            if path is None:
                text = f"a path cannot be decoded as {raw.type}"
                self.problems.append(Problem("error", "unreadable", raw.topic, text, t=t))
                continue
            points, frame = path
            if expected and frame != expected:
                text = f"path in frame {frame!r}, expected {expected!r}"
                self.problems.append(Problem("error", "wrong_frame", raw.topic, text, t=t))
            paths.append(ReferencePath(t, points, frame))
        return tuple(paths)

    def summary(self, raw: RawTopic, axis: TimeAxis) -> TopicSummary:
        roles = {
            full_name(self.namespace, rule.topic): role for role, rule in self.topics.rules.items()
        }
        role = roles.get(raw.topic, "")
        clock = self.clocks.get(raw.topic, self.topics.rules[role].clock if role else MASTER)
        stamp_ns = stamps_of_prefixes(raw)
        t_arrival = axis.arrived(raw.arrival_ns)
        if stamp_ns is None:
            return summarise(raw, role, t_arrival, t_arrival, np.zeros(len(t_arrival), dtype=bool))
        stamped = stamp_ns != 0  # ROS: a time of zero is none
        t = np.where(stamped, axis.measured(clock, stamp_ns), t_arrival)
        return summarise(raw, role, t, t_arrival, stamped)
