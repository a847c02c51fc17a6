# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When each recorded message is due: pure timing of a replay, with rate, pause and loop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fish_bag.bag import RawTopic, read_bag
from fish_bag.problem import RecordingError
from fish_bag.recorder_config import is_selected

LEAST_ROUND_NS = 100_000_000  # steady time of a round that is repeated


@dataclass(frozen=True)
class ReplayerConfig:
    """ROS parameters of the replayer."""

    recording: str = ""  # rosbag2 folder or .mcap file
    rate: float = 1.0  # times as fast as recorded, 0.01 to 100
    loop: bool = False  # start again at the end
    paused: bool = False  # wait for the pause service to be called with false
    topics: tuple[str, ...] = (
        "*",
        "/*",
    )  # names or patterns, relative to the node's namespace or absolute; arming/* only where one names it
    exclude: tuple[str, ...] = ("",)  # taken out of these
    clock_hz: float = (
        100.0  # Hz of bag time on /clock unless the recording has a /clock of its own; 0: none
    )
    start_delay_s: float = (
        3.0  # s before the first message: subscribers need up to 2 s to find publishers
    )

    def __post_init__(self) -> None:
        if not 0.01 <= self.rate <= 100.0:
            raise ValueError(f"rate = {self.rate}: expected 0.01 to 100")
        if not 0.0 <= self.clock_hz <= 1000.0:
            raise ValueError(f"clock_hz = {self.clock_hz}: expected 0 to 1000 Hz")
        if not 0.0 <= self.start_delay_s <= 60.0:
            raise ValueError(f"start_delay_s = {self.start_delay_s}: expected 0 to 60 s")


class PlaybackClock:
    """Bag time against the replaying machine's steady time.

    bag = bag_0 + rate (steady - steady_0),  standing still while paused
    """

    def __init__(self, rate: float, bag_ns: int, steady_ns: int, paused: bool = False) -> None:
        self._rate, self._bag_ns, self._steady_ns, self.paused = rate, bag_ns, steady_ns, paused

    def bag_time(self, steady_ns: int) -> int:
        """Bag time now [ns]."""
        return (
            self._bag_ns
            if self.paused
            else self._bag_ns + round((steady_ns - self._steady_ns) * self._rate)
        )

    def wait(self, bag_ns: int, steady_ns: int) -> int:
        """Steady nanoseconds until bag_ns is reached (0 if it is past), for a clock that runs."""
        return max(0, round((bag_ns - self.bag_time(steady_ns)) / self._rate))

    def set_paused(self, paused: bool, steady_ns: int) -> None:
        """Stop or go on, from the same bag time."""
        self._bag_ns, self._steady_ns, self.paused = self.bag_time(steady_ns), steady_ns, paused

    def restart(self, bag_ns: int, steady_ns: int) -> None:
        """Jump to a bag time."""
        self._bag_ns, self._steady_ns = bag_ns, steady_ns


def of_arming(name: str) -> bool:
    """Whether a topic or pattern names the arming state: a robot that hears a recorded one may take it for its own."""
    return "/arming/" in f"/{name}"


class Playback:
    """The selected messages of one recording in order of arrival, undecoded."""

    def __init__(self, config: ReplayerConfig, namespace: str) -> None:
        if not config.recording:
            raise RecordingError(
                "parameter recording is empty: expected a rosbag2 folder or .mcap file"
            )
        path = Path(config.recording).expanduser()

        naming_arming = tuple(pattern for pattern in config.topics if of_arming(pattern))

        def selected(topic: str, _: str = "") -> bool:
            wanted = naming_arming if of_arming(topic) else config.topics
            return is_selected(topic, wanted, namespace) and not is_selected(
                topic, config.exclude, namespace
            )

        bag = read_bag(path, selected)
        if bag.topics and all(raw.ros1 for raw in bag.topics):
            raise RecordingError(
                f"{path}: ROS 1 bags are not replayed; expected a rosbag2 folder or .mcap file"
            )
        self.notes = bag.notes
        self.topics = [raw for raw in bag.topics if raw.raws and selected(raw.topic)]
        if not self.topics:
            held = ", ".join(sorted({raw.topic for raw in bag.topics})) or "nothing"
            raise RecordingError(f"{path}: no message on the selected topics; it holds {held}")
        self.start_ns = min(int(raw.arrival_ns[0]) for raw in bag.topics if raw.raws)
        self.end_ns = max(int(raw.arrival_ns.max()) for raw in self.topics)
        self._rate = config.rate

    @property
    def rest_ns(self) -> int:
        """Steady nanoseconds between two rounds: none, but behind a recording that is almost a moment."""
        return max(0, LEAST_ROUND_NS - round((self.end_ns - self.start_ns) / self._rate))

    def messages(self) -> Iterator[tuple[RawTopic, int, bytes]]:
        """Topic, arrival [ns] and raw message; every call starts anew."""
        yield from in_order(self.topics)


def in_order(topics: Sequence[RawTopic]) -> Iterator[tuple[RawTopic, int, bytes]]:
    """Topic, arrival [ns] and raw message of several topics in order of arrival."""
    arrival_ns = np.concatenate([raw.arrival_ns for raw in topics])
    which = np.repeat(np.arange(len(topics)), [len(raw.raws) for raw in topics])
    places = np.concatenate([np.arange(len(raw.raws)) for raw in topics])
    order = np.argsort(arrival_ns, kind="stable")
    for time_ns, k, i in zip(
        arrival_ns[order].tolist(), which[order].tolist(), places[order].tolist(), strict=True
    ):
        yield topics[k], time_ns, topics[k].raws[i]
