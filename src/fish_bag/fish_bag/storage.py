# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What one storage file of a recording holds: topics, messages, and what is wrong with the file.

The compression of a whole file, a chunk or a single message is known by its first bytes.
"""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import inf
from mmap import mmap
from typing import Any

import lz4.frame
import zstandard

Buffer = bytes | mmap
CUSTOM_NAMES = ("fish_bag", "fish_train")  # of MCAP metadata records with a recording's custom data
ROSBAG2_NAME = "rosbag2"  # of the MCAP metadata record with a copy of metadata.yaml
BLOCK = 1 << 16
ENOUGH_OTHERS = 8  # messages that show in how many zeros those of a topic end
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no serialised message begins like this: CDR begins with a zero
LZ4_MAGIC = b"\x04\x22\x4d\x18"
PIECE = {"zstd": 1 << 10, "lz4": 1 << 16, "bz2": 1 << 10}  # bytes that unpack to at most 32 MiB
LEAST_LIMIT = 1 << 24  # bytes to which a chunk may unpack whatever its damaged head says
COMPRESSIONS = ("", "none", "zstd", "lz4", "bz2")  # names of compressions; the first two are none
PACKING_DAMAGE = (zstandard.ZstdError, RuntimeError, MemoryError, OSError, EOFError, ValueError)


@dataclass(frozen=True)
class StoredTopic:
    """A topic as one storage file describes it."""

    name: str
    type: str  # "sensor_msgs/msg/Imu"
    serialization: str = "cdr"  # of the messages: "cdr", "ros1", "protobuf" ...
    definition: bytes = b""  # of the type
    encoding: str = ""  # of the definition: "ros2msg", "ros2idl", "ros1msg" ...
    qos: str = ""  # offered_qos_profiles as YAML
    hash: str = ""  # of the type: RIHS01 in ROS 2, MD5 in ROS 1


@dataclass
class Messages:
    """Messages of one channel in the order of the file."""

    times: list[int] = field(default_factory=list)  # arrival [ns]
    raws: list[bytes] = field(default_factory=list)

    def add(self, time_ns: int, raw: bytes) -> None:
        self.times.append(time_ns)
        self.raws.append(raw)

    def __len__(self) -> int:
        return len(self.raws)


@dataclass
class Contents:
    """Everything found in one file."""

    topics: dict[int, StoredTopic] = field(default_factory=dict)  # by channel
    messages: dict[int, Messages] = field(default_factory=dict)  # by channel
    custom: dict[str, str] = field(default_factory=dict)
    metadata: str = ""  # copy of metadata.yaml inside the file
    lost: list[str] = field(default_factory=list)  # what cannot be read, one sentence each
    notes: list[str] = field(default_factory=list)  # what is odd though nothing is lost

    @property
    def count(self) -> int:
        return sum(map(len, self.messages.values()))

    def drop_undefined(self) -> None:
        """Take out messages of channels without a topic and type: they are only bytes."""
        for channel in sorted(set(self.messages) - set(self.topics)):
            gone = len(self.messages.pop(channel))
            if gone:
                self.lost.append(
                    f"{gone} messages of channel {channel}, whose topic or type is lost"
                )

    def compare_counts(self, stated: dict[int, int], where: str) -> None:
        """Note every channel of which the file states another number of messages than it holds."""
        for channel in sorted(set(stated) | set(self.messages)):
            found, said = len(self.messages.get(channel, ())), stated.get(channel, 0)
            if found != said:
                name = self.topics[channel].name if channel in self.topics else f"channel {channel}"
                self.notes.append(f"{name}: {found} messages are in the file, {where} say {said}")


Keep = Callable[[StoredTopic], int | None]  # bytes kept of every message, None: all


def keep_whole(_: StoredTopic) -> None:
    """Keep every message whole."""


def end_of_content(data: Buffer) -> int:
    """Position after the last byte that is not zero: a file system fills up a file with zeros after a power loss."""
    end = len(data)
    while end:
        start = max(0, end - BLOCK)
        kept = len(bytes(data[start:end]).rstrip(b"\0"))
        if kept:
            return start + kept
        end = start
    return 0


def ends_like_others(raw: bytes, others: list[bytes]) -> bool:
    """Whether a message that reaches into zeros ends in no more zero bytes than the others of its topic do.

    Then its own bytes are zeros there as well, and it is whole. False also where too little is known: with few others, or
    where all of it is zeros.
    """
    own = len(raw) - len(raw.rstrip(b"\0"))
    if raw and not own:
        return True
    return (
        len(others) >= ENOUGH_OTHERS
        and own < len(raw)
        and own <= min(len(o) - len(o.rstrip(b"\0")) for o in others[-100:])
    )


def filled(raw: bytes, data: Buffer, position: int) -> bool:
    """Whether only one byte value follows from `position` on, as in flash memory that was erased, and `raw` ends in it."""
    fill = bytes(data[-1:])
    return raw.endswith(fill) and not bytes(data[position:]).strip(fill)


def _decompressor(name: str) -> Any:
    if name == "zstd":
        return zstandard.ZstdDecompressor().decompressobj()
    if name == "lz4":
        return lz4.frame.LZ4FrameDecompressor()
    if name == "bz2":
        return BZ2Decompressor()
    raise ValueError(f"compression {name!r} is not known; expected zstd, lz4, bz2 or none")


def unpack(name: str, packed: bytes, stated: int | None = None) -> tuple[bytes, bool]:
    """Unpack all that there is, also where the end is cut off, and whether it is whole.

    Args:
        name: "zstd", "lz4", "bz2", or "" or "none" for data that are not packed.
        stated: bytes that it is said to unpack to; much more is not unpacked. None: without a limit.

    Raises:
        one of PACKING_DAMAGE: the bytes make no sense, or the compression is unknown.
    """
    if name in COMPRESSIONS[:2]:
        return packed, True
    limit = inf if stated is None else max(stated, LEAST_LIMIT)
    parts, count, whole = [], 0, True
    for piece in unpack_pieces(name, packed, _piece(name, packed, limit)):
        part, whole = piece
        parts.append(part)
        count += len(part)
        if count > limit:
            raise ValueError(f"it unpacks to more than the {stated} bytes that its head states")
    return b"".join(parts), whole


def unpack_pieces(name: str, packed: Buffer, piece: int = 0) -> Iterator[tuple[bytes, bool]]:
    """Unpack piece by piece: what each one gives, and whether the data would be whole if they ended there.

    Args:
        name: "zstd", "lz4" or "bz2".
        piece: packed bytes at a time; 0: few enough that none fills the memory.

    Raises:
        one of PACKING_DAMAGE: the bytes make no sense, or the compression is unknown.
    """
    decompressor, position = None, 0
    while position < len(packed):
        if decompressor is None or decompressor.eof:
            decompressor = _decompressor(name)
        given = bytes(packed[position : position + (piece or PIECE[name])])
        unpacked = bytes(decompressor.decompress(given))
        left = len(decompressor.unused_data or b"") if decompressor.eof else 0
        position += len(given) - left
        yield unpacked, decompressor.eof


def _piece(name: str, packed: bytes, limit: float) -> int:
    """Packed bytes at a time: all where nothing is limited or where the data themselves say that they fit."""
    if limit == inf:
        return len(packed)
    if name != "zstd":
        return PIECE.get(name, 0)
    try:
        stated = zstandard.frame_content_size(packed)
    except zstandard.ZstdError:  # not even the head of a frame
        return len(packed)
    if stated > limit:
        raise ValueError(f"it states that it unpacks to {stated} bytes")
    return len(packed) if stated >= 0 else PIECE[name]


def name_by_magic(head: bytes) -> str:
    """The compression that bytes begin with, "" for none."""
    return {ZSTD_MAGIC: "zstd", LZ4_MAGIC: "lz4"}.get(head[:4], "")


def unpack_message(raw: bytes) -> bytes | None:
    """A message without the compression of rosbag2's mode `message`; None where it is packed and not whole."""
    name = name_by_magic(raw)
    if not name:
        return raw
    try:
        data, whole = unpack(name, raw)
    except PACKING_DAMAGE:
        return None
    return data if whole else None
