"""Raw contents of a recording file or directory, through rosbags: bytes and arrival times per topic."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import get_types_from_idl, get_types_from_msg

from fish_bag.message_types import typestore
from fish_bag.problem import RecordingError

STAMP_PREFIX = 16  # bytes kept of messages nobody decodes: enough for the stamp of a header
PARTS = (".mcap", ".db3")  # of files in a rosbag2 folder
SUFFIXES = (*PARTS, ".bag")


@dataclass
class RawTopic:
    """Messages of one topic in order of arrival."""

    topic: str
    type: str
    arrival_ns: np.ndarray  # (N,) int64
    raws: list[bytes]  # whole messages, or the first STAMP_PREFIX bytes where `whole` is False
    whole: bool


@dataclass
class RawBag:
    """Everything the reader needs of one recording."""

    path: Path
    ros1: bool
    types: Typesdict
    topics: list[RawTopic]
    metadata: dict[str, str] = field(default_factory=dict)

    @property
    def count(self) -> int:
        return sum(len(topic.raws) for topic in self.topics)


def is_recording(path: Path) -> bool:
    """Whether `path` looks like one recording (not: is readable)."""
    if path.is_dir():
        return (path / "metadata.yaml").exists() or bool(parts(path))
    return path.suffix in SUFFIXES


def parts(folder: Path) -> list[Path]:
    """Storage files of the one recording in a folder without metadata.yaml; [] where they are recordings of their own.

    rosbag2 splits a long recording into <folder>_0, <folder>_1 and so on.
    """
    inside = sorted(folder.iterdir())
    files = [p for p in inside if p.suffix in PARTS]
    split = re.compile(rf"{re.escape(folder.name)}_\d+")
    own = len(files) == 1 or all(split.fullmatch(file.stem) for file in files)
    beside = bool(files) and any(is_recording(p) for p in inside if p.is_dir())
    return files if own and not beside else []


def is_pool_bag(bag: RawBag) -> bool:
    """Whether the bag is one of the real robot's ROS 1 bags, with message types of their own."""
    return {"/runcam_tracking", "/purepursuit_target"} <= {raw.topic for raw in bag.topics}


def read_bag(path: Path, wanted: Callable[[str, str], bool]) -> RawBag:
    """Read one recording.

    Args:
        path: rosbag2 directory, bare .mcap or .db3 file, or ROS 1 .bag file.
        wanted: (topic, type) -> whether its messages are kept whole.

    Raises:
        RecordingError: nothing there, empty, truncated or not a recording; the text says what to do.
    """
    source = storage(path)
    ros1 = source.suffix == ".bag"
    with damage_is_said(path), (rosbag1.Reader if ros1 else rosbag2.Reader)(source) as reader:
        topics = _collect(reader, wanted)
        types = _types(reader.connections, ros1)
        metadata = (
            {} if isinstance(reader, rosbag1.Reader) else reader.storage.metadata.custom or {}
        )
    bag = RawBag(path, ros1, types, topics, {str(k): str(v) for k, v in metadata.items()})
    if not bag.count:
        raise RecordingError(
            f"{path}: the recording holds no messages; was anything published while it ran?"
        )
    return bag


@contextmanager
def damage_is_said(path: Path) -> Iterator[None]:
    """Whatever rosbags stumbles into when it reads damaged bytes as a RecordingError that says what to do."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # of every kind, as damaged bytes lead anywhere
        raise RecordingError(
            f"{path}: {_advice(path, str(error) or type(error).__name__)}"
        ) from error


def storage(path: Path) -> Path:
    """The path rosbags can open: the directory, or the only storage file of one without metadata.yaml."""
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    if path.is_file():
        if path.suffix not in SUFFIXES:
            raise RecordingError(
                f"{path}: not a recording; expected a rosbag2 directory or a file {', '.join(SUFFIXES)}"
            )
        if not path.stat().st_size:
            raise RecordingError(f"{path}: the file is empty (0 bytes)")
        return path
    if (path / "metadata.yaml").exists():
        return path
    files = sorted(p for p in path.iterdir() if p.suffix in SUFFIXES)
    if len(files) == 1:
        return files[0]
    if parts(path):
        advice = f"'robofish recover {path}' writes a new metadata.yaml"
    else:
        advice = "give one of the recordings in it" if files else "there is no recording in it"
    raise RecordingError(
        f"{path}: no metadata.yaml and {len(files)} storage files; expected a rosbag2 directory; {advice}"
    )


def _collect(
    reader: rosbag1.Reader | rosbag2.Reader, wanted: Callable[[str, str], bool]
) -> list[RawTopic]:
    """All messages by topic and type (a topic with two types gives two entries)."""
    keep: dict[int, bool] = {}
    raws: dict[tuple[str, str], list[bytes]] = {}
    times: dict[tuple[str, str], list[int]] = {}
    slots: dict[int, tuple[list[bytes], list[int]]] = {}
    for c in reader.connections:
        key = (c.topic, c.msgtype)
        slots[c.id] = (raws.setdefault(key, []), times.setdefault(key, []))
        keep[c.id] = wanted(*key)
    for connection, arrival, raw in reader.messages():
        bucket, stamps = slots[connection.id]
        bucket.append(raw if keep[connection.id] else raw[:STAMP_PREFIX])
        stamps.append(arrival)
    return [
        RawTopic(
            topic, msgtype, np.array(times[topic, msgtype], np.int64), raw, wanted(topic, msgtype)
        )
        for (topic, msgtype), raw in raws.items()
    ]


def _types(connections: list[Connection], ros1: bool) -> Typesdict:
    """Definitions stored with the recording, on top of the usual ones."""
    types: Typesdict = dict(typestore(ros1).fielddefs)
    for connection in connections:
        if connection.msgdef.format != MessageDefinitionFormat.NONE:
            types.update(
                _definition(connection.msgtype, connection.msgdef.format, connection.msgdef.data)
            )
    return types


@lru_cache(maxsize=256)
def _definition(msgtype: str, form: MessageDefinitionFormat, text: str) -> Typesdict:
    """Parsed definition; the same texts come again with every trial of a data set."""
    if form == MessageDefinitionFormat.MSG:
        return get_types_from_msg(text, msgtype)
    types: Typesdict = {}
    for part in text.split("=" * 80 + "\n"):
        idl = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
        if idl.strip():
            types.update(get_types_from_idl(idl))
    return types


def _advice(path: Path, error: str) -> str:
    """What the reader said, in one line, and what can be done about it."""
    error = " ".join(error.split())
    if "empty" in error:
        return "the file is empty"
    if path.suffix == ".bag":
        return f"not a complete ROS 1 bag ({error.rstrip('.')}); mend it with 'rosbag reindex'"
    return (
        f"truncated or damaged ({error.rstrip('.')}); 'robofish recover {path}' saves what is left"
    )
