# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every message of a ROS 1 bag in the order of the file, with or without index.

Nothing in this format has a checksum but the chunks that bz2 packs: a changed byte in a message stays unseen.
Source: wiki.ros.org/Bags/Format/2.0.
"""

from __future__ import annotations

import re
import struct
from collections import Counter

from fish_bag.message_types import ros2_type_name
from fish_bag.storage import (
    PACKING_DAMAGE,
    Buffer,
    Contents,
    Keep,
    Messages,
    StoredTopic,
    end_of_content,
    ends_like_others,
    keep_whole,
    unpack,
)

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
LENGTH, TIME, COUNT = struct.Struct("<I"), struct.Struct("<II"), struct.Struct("<II")
NS_PER_S = 1_000_000_000
DAMAGE = (struct.error, ValueError, KeyError)  # of parsing a damaged record
CHUNK_START = re.compile(
    rb"(?=.{4}(?:\x10\0\0\0compression=none|\x0f\0\0\0compression=(?:bz2|lz4)|\x04\0\0\0op=\x05))",
    re.DOTALL,
)
Record = tuple[dict[bytes, bytes], int, int]  # header fields, first byte of the data, byte after


def scan_ros1(data: Buffer, keep: Keep = keep_whole) -> Contents:
    """Collect every message that can be read.

    Args:
        data: the file.
        keep: how many bytes of the messages of a topic are kept.
    """
    scan = _Scan(data, keep)
    scan.walk()
    return scan.contents


class _Scan:
    """One walk through one file."""

    def __init__(self, data: Buffer, keep: Keep) -> None:
        self.data, self.keep = data, keep
        self.content_end = end_of_content(data)
        self.contents = Contents()
        self.lost = self.contents.lost
        self.kept: dict[int, int | None] = {}
        self.counts: Counter[int] = Counter()  # connection -> messages, as the index says
        self.indexed = False

    def walk(self) -> None:
        """Read all records from the first byte to the last."""
        position: int | None = len(MAGIC)
        if self.data[: len(MAGIC)] != MAGIC:
            head = bytes(self.data[: len(MAGIC)])
            self.lost.append(f"the file begins with {head!r}, expected {MAGIC!r}")
            position = self.nonsense(0)
        while position is not None and position < len(self.data):
            position = self.step(position)
        self.contents.drop_undefined()
        if not self.indexed:
            self.lost.insert(0, "a ROS 1 bag without index, as it was not closed")
        elif not self.lost:
            self.contents.compare_counts(dict(self.counts), "its index")

    def step(self, position: int) -> int | None:
        """Read the record at `position`; where the next one is, None at the end."""
        if position >= self.content_end:
            count = len(self.data) - position
            self.lost.append(f"{count} zero bytes from byte {position} to the end")
            return None
        try:
            fields, start, end = _record(self.data, position)
            operation = fields[b"op"][0]
            if operation == CHUNK:
                self.chunk(fields, position, start, end)
            elif end > len(self.data):
                self.lost.append(f"the record at byte {position}, which is cut")
                return None
            elif operation == MESSAGE and not self.message(
                self.data, fields, start, end, self.content_end
            ):
                self.lost.append(f"the message at byte {position}, which reaches into zeros")
            else:
                self.other(operation, fields, self.data[start:end])
        except DAMAGE:
            return self.nonsense(position)
        return end

    def nonsense(self, position: int) -> int | None:
        """Go on at the next whole chunk after bytes that make no sense."""
        for found in CHUNK_START.finditer(self.data, position + 1):
            try:
                fields, _, end = _record(self.data, found.start())
            except DAMAGE:
                continue
            if fields.get(b"op") == bytes([CHUNK]) and end <= len(self.data):
                gap = found.start() - position
                self.lost.append(f"{gap} bytes from byte {position} on make no sense")
                return found.start()
        count = len(self.data) - position
        self.lost.append(f"{count} bytes from byte {position} on make no sense")
        return None

    def chunk(self, fields: dict[bytes, bytes], position: int, start: int, end: int) -> None:
        """Take the records of a chunk; of a cut one those before the cut."""
        name, (size,) = fields[b"compression"].decode(), LENGTH.unpack(fields[b"size"])
        cut = end > self.content_end
        stop = min(end, len(self.data)) if name == "none" else min(end, self.content_end)
        try:
            records, _ = unpack(name, bytes(self.data[start:stop]), size)
        except PACKING_DAMAGE as error:
            self.lost.append(f"chunk at byte {position} cannot be read ({error})")
            return
        if len(records) != size and not cut:
            text = f"{len(records)} bytes, {size} expected"
            self.lost.append(f"chunk at byte {position} is damaged ({text}); left out")
            return
        limit = self.content_end - start if name == "none" else len(records)
        saved, whole = self.records(records, limit)
        if not whole or len(records) != size:
            self.lost.append(
                f"the chunk at byte {position} is cut; its first {saved} messages are saved, the rest is lost"
            )

    def records(self, data: bytes, content_end: int) -> tuple[int, bool]:
        """Take the records of a chunk as far as they are whole: messages taken, and whether all were."""
        position, saved = 0, 0
        while position < len(data):
            try:
                fields, start, end = _record(data, position)
                operation = fields[b"op"][0]
                if end > len(data):
                    return saved, False
                if operation == MESSAGE:
                    if not self.message(data, fields, start, end, content_end):
                        return saved, False
                    saved += 1
                else:
                    self.other(operation, fields, data[start:end])
            except DAMAGE:
                return saved, False
            position = end
        return saved, True

    def message(
        self, data: Buffer, fields: dict[bytes, bytes], start: int, end: int, content_end: int
    ) -> bool:
        """Take one message; False if it reaches into the zeros at the file's end."""
        (connection,) = LENGTH.unpack(fields[b"conn"])
        seconds, nanoseconds = TIME.unpack(fields[b"time"])
        size = self.kept.get(connection)
        raw = bytes(data[start : end if size is None else min(end, start + size)])
        found = self.contents.messages.setdefault(connection, Messages())
        if end > content_end and not ends_like_others(raw, found.raws):
            return False
        found.add(seconds * NS_PER_S + nanoseconds, raw)
        return True

    def other(self, operation: int, fields: dict[bytes, bytes], data: bytes) -> None:
        """Take a record that is no message."""
        if operation == CONNECTION:
            (connection,) = LENGTH.unpack(fields[b"conn"])
            inner = _fields(bytes(data))
            topic = StoredTopic(
                fields[b"topic"].decode(),
                ros2_type_name(inner[b"type"].decode()),
                "ros1",
                inner[b"message_definition"],
                "ros1msg",
                hash=inner[b"md5sum"].decode(),
            )
            if connection not in self.contents.topics:  # the index says it once more
                self.contents.topics[connection] = topic
                self.kept[connection] = self.keep(topic)
        elif operation == CHUNK_INFO:
            for at in range(0, len(data), COUNT.size):
                connection, count = COUNT.unpack_from(data, at)
                self.counts[connection] += count
        elif operation == BAG_HEADER:
            self.indexed = any(fields[b"index_pos"])
            if fields.get(b"encryptor"):
                self.lost.append("an encrypted bag, which cannot be read")


def _record(data: Buffer, position: int) -> Record:
    """Header fields, first byte of the data and byte after them; one of DAMAGE if they make no sense."""
    (size,) = LENGTH.unpack_from(data, position)
    at = position + LENGTH.size + size
    if at + LENGTH.size > len(data):
        raise ValueError("the record's head is cut")
    fields = _fields(bytes(data[position + LENGTH.size : at]))
    (length,) = LENGTH.unpack_from(data, at)
    return fields, at + LENGTH.size, at + LENGTH.size + length


def _fields(header: bytes) -> dict[bytes, bytes]:
    fields, position = {}, 0
    while position < len(header):
        (size,) = LENGTH.unpack_from(header, position)
        position += LENGTH.size
        name, separator, value = header[position : position + size].partition(b"=")
        if not separator or position + size > len(header):
            raise ValueError("a field of the header makes no sense")
        fields[name] = value
        position += size
    return fields
