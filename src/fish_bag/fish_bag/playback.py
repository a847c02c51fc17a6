"""When each recorded message is due: pure timing of a replay, with rate, pause and loop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags import rosbag2
from rosbags.interfaces import Connection, ConnectionExtRosbag2, QosDurability, QosReliability

from fish_bag.bag import damage_is_said, storage
from fish_bag.problem import RecordingError
from fish_bag.qos import Qos
from fish_bag.recorder_config import is_selected


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
    )  # names or patterns, relative to the node's namespace or absolute
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


class Playback:
    """The selected messages of one recording in order of arrival, undecoded."""

    def __init__(self, config: ReplayerConfig, namespace: str) -> None:
        if not config.recording:
            raise RecordingError(
                "parameter recording is empty: expected a rosbag2 folder or .mcap file"
            )
        self._path = path = Path(config.recording).expanduser()
        source = storage(path)
        if source.suffix == ".bag":
            raise RecordingError(
                f"{path}: ROS 1 bags are not replayed; expected a rosbag2 folder or .mcap file"
            )
        with damage_is_said(path):
            self._reader = rosbag2.Reader(source)
            self._reader.open()
        self.connections = [
            c
            for c in self._reader.connections
            if is_selected(c.topic, config.topics, namespace)
            and not is_selected(c.topic, config.exclude, namespace)
        ]
        if not any(c.msgcount for c in self.connections):
            held = ", ".join(sorted({c.topic for c in self._reader.connections})) or "nothing"
            self.close()
            raise RecordingError(f"{path}: no message on the selected topics; it holds {held}")
        self.start_ns = self._reader.start_time

    def messages(self) -> Iterator[tuple[Connection, int, bytes]]:
        """Connection, arrival [ns] and raw message; every call starts anew.

        Raises:
            RecordingError: the file is damaged from here on.
        """
        with damage_is_said(self._path):
            yield from self._reader.messages(self.connections)

    def close(self) -> None:
        """Close the files."""
        self._reader.close()


def offered_qos(connection: Connection) -> Qos:
    """What the recorded publisher offered."""
    profiles = (
        connection.ext.offered_qos_profiles
        if isinstance(connection.ext, ConnectionExtRosbag2)
        else []
    )
    if not profiles:
        return Qos()
    return Qos(
        reliable=profiles[0].reliability != QosReliability.BEST_EFFORT,
        transient_local=profiles[0].durability == QosDurability.TRANSIENT_LOCAL,
        depth=max(1, profiles[0].depth),
    )
