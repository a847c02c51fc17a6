# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Typed streams from raw topics: header stamps, frames and values of every message, nothing left out.

Every topic is counted, mapped or not: rates, gaps and latencies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fish_bag.bag import RawTopic
from fish_bag.decode import Role
from fish_bag.layout import Block, decode_blocks
from fish_bag.message_types import types_of, typestore
from fish_bag.trial import TopicSummary

NS_PER_S = 1_000_000_000


@dataclass
class Decoded:
    """One topic's messages as arrays; times are still on the clocks that made them."""

    topic: str
    arrival_ns: np.ndarray  # (N,) int64
    stamp_ns: np.ndarray | None  # (N,) int64, None without a header
    frames: np.ndarray | None  # (N,) str
    arrays: dict[str, np.ndarray]  # fields of the role's stream, (N, ...)
    names: tuple[str, ...]
    unreadable: np.ndarray  # positions of messages that cannot be decoded
    joints: tuple[str, ...] = ()  # names in messages of joints, in order of first appearance


def decode_topic(raw: RawTopic, role: Role) -> Decoded:
    """Decode all messages of one topic into the arrays of its role; values not there become NaN."""
    blocks, unreadable = topic_blocks(raw, raw.raws)
    count = len(raw.raws)
    stamp_ns, frames = _headers(blocks, count, raw)
    names = _names(blocks, role)
    arrays: dict[str, np.ndarray] = {}
    for block in blocks:
        for name, values in role.decode(block).items():
            if role.names == "name":
                values = _by_name(values, block.texts["name"], names)
            _put(arrays, name, values, block.index, count)
    joints = tuple(dict.fromkeys(n for block in blocks for n in block.texts.get("name", [])))
    return Decoded(raw.topic, raw.arrival_ns, stamp_ns, frames, arrays, names, unreadable, joints)


def topic_blocks(raw: RawTopic, messages: list[bytes]) -> tuple[list[Block], np.ndarray]:
    """Decode messages of a topic, as `decode_blocks` does; no other serialisation than CDR and ROS 1's is known."""
    if raw.stored.serialization not in ("cdr", "ros1"):
        return [], np.arange(len(messages))
    return decode_blocks(messages, raw.type, types_of(raw.stored)[0], raw.ros1)


def stamps_of_prefixes(raw: RawTopic) -> np.ndarray | None:
    """Header stamps of messages of which the first bytes were kept, (N,) int64 ns; None without a header.

    Only the common interfaces are known here: definitions of foreign topics are not parsed.
    """
    definition = typestore(raw.ros1).fielddefs.get(raw.type)
    if (
        raw.stored.serialization not in ("cdr", "ros1")
        or definition is None
        or not definition[1]
        or definition[1][0][1][1] != "std_msgs/msg/Header"
    ):
        return None
    start = 4  # CDR header in ROS 2, sequence number in ROS 1
    if any(len(m) < start + 8 for m in raw.raws):
        return None
    rows = np.frombuffer(b"".join(m[:12] for m in raw.raws), np.uint8).reshape(-1, 12)
    order = "<" if raw.ros1 or rows[0, 1] else ">"
    pairs = np.ascontiguousarray(rows[:, start:]).view(f"{order}u4").astype(np.int64)
    return pairs[:, 0] * NS_PER_S + pairs[:, 1]


def decode_paths(raw: RawTopic) -> list[tuple[np.ndarray, str] | None]:
    """Points (P, 2) and frame of every nav_msgs/Path, None where one cannot be decoded; one by one, as lengths vary."""
    paths: list[tuple[np.ndarray, str] | None] = []
    for message in raw.raws:
        blocks, _ = topic_blocks(raw, [message])
        paths += [_path(block) for block in blocks] or [None]
    return paths


def _path(block: Block) -> tuple[np.ndarray, str]:
    xy = [
        block.values[path]
        for path in block.values
        if path.endswith(("pose.position.x", "pose.position.y"))
    ]
    return np.array(xy, float).reshape(-1, 2), block.texts["header.frame_id"][0]


def _headers(
    blocks: list[Block], count: int, raw: RawTopic
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Stamps and frames of messages with a header; unreadable messages get their arrival time."""
    if not any("header.stamp.sec" in block.values for block in blocks):
        return None, None
    stamp_ns = raw.arrival_ns.copy()
    frames = np.full(count, "", object)
    for block in blocks:
        sec = block.values["header.stamp.sec"].astype(np.int64)
        stamp_ns[block.index] = sec * NS_PER_S + block.values["header.stamp.nanosec"]
        frames[block.index] = block.texts["header.frame_id"][0]
    return stamp_ns, frames


def _names(blocks: list[Block], role: Role) -> tuple[str, ...]:
    """Column names, in order of first appearance."""
    if role.names is None:
        return ()
    seen: dict[str, None] = {}
    for block in blocks:
        for text in block.texts.get(role.names, []):
            seen.update(dict.fromkeys(text.split(",")))
    return tuple(seen)


def _by_name(values: np.ndarray, names: list[str], wanted: tuple[str, ...]) -> np.ndarray:
    """(n, len(wanted)) columns of `values` in the order of `wanted`, NaN where a message lacks one."""
    columns = np.full((len(values), len(wanted)), np.nan)
    for i, name in enumerate(wanted):
        if name in names and names.index(name) < values.shape[1]:
            columns[:, i] = values[:, names.index(name)]
    return columns


def _put(
    arrays: dict[str, np.ndarray], name: str, values: np.ndarray, index: np.ndarray, count: int
) -> None:
    """Write one block's rows, widening the array when this block has more columns than those before."""
    have = arrays.setdefault(name, np.full((count, *values.shape[1:]), np.nan))
    if have.ndim == 2 and values.shape[1] > have.shape[1]:
        wider = np.full((count, values.shape[1]), np.nan)
        wider[:, : have.shape[1]] = have
        have = arrays[name] = wider
    if have.ndim == 2:
        have[index, : values.shape[1]] = values
    else:
        have[index] = values


def summarise(
    raw: RawTopic, role: str, t: np.ndarray, t_arrival: np.ndarray, stamped: np.ndarray
) -> TopicSummary:
    """One topic; `t` is the moment of measurement, or the arrival of messages that are not stamped (N,)."""
    steps = np.diff(np.sort(t))
    span = float(np.sum(steps))
    ages = (t_arrival - t)[stamped]
    latency = np.quantile(ages, [0.01, 0.5, 0.99]) if len(ages) else [np.nan] * 3
    return TopicSummary(
        topic=raw.topic,
        type=raw.type,
        count=len(t),
        rate_hz=(len(t) - 1) / span if span > 0 else np.nan,
        period_s=float(np.median(steps)) if len(steps) else np.nan,
        longest_gap_s=float(steps.max()) if len(steps) else np.nan,
        latency_s=(float(latency[0]), float(latency[1]), float(latency[2])),
        role=role,
        stamped=bool(stamped.any()),
    )
