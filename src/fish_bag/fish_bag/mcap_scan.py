# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every message of an MCAP file in the order of the file, whole or damaged: no index is needed.

The file is walked record by record with the record classes of the mcap package. Its StreamReader does not serve here: it takes
a record that the file's end cuts for a whole one, it cannot go on after damage, and it builds objects for every message.
A chunk whose checksum holds is whole. Of a chunk that is cut, or that reaches into the zeros with which a file system fills
a file after a power loss, the messages before that place are kept. Any other chunk with a wrong checksum is left out.
After bytes that make no sense the walk goes on at the next whole chunk.
Source: MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from fish_bag.mcap_records import (
    CHUNK_START,
    DAMAGE,
    HEAD,
    OPCODES,
    PRIVATE,
    another_file,
    begins_record,
    check_length,
    checksum_holds,
    chunk_head,
    compare_statistics,
    cut_chunk,
    read_summary,
    topics_of,
    whole_chunk,
    whole_record,
)  # fmt: skip
from fish_bag.storage import (
    COMPRESSIONS,
    CUSTOM_NAMES,
    ROSBAG2_NAME,
    Buffer,
    Contents,
    Keep,
    Messages,
    end_of_content,
    ends_like_others,
    filled,
    keep_whole,
)

MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
RECORDS: dict[int, type[Any]] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
}
MESSAGE = int(Opcode.MESSAGE)


def scan_mcap(data: Buffer, keep: Keep = keep_whole) -> Contents:
    """Collect every message of a file that can be read; keep: how many bytes of the messages of a topic are kept."""
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
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.kept: dict[int, int | None] = {}  # channel -> bytes kept of every message
        self.loose: dict[int, Messages] = {}  # messages outside of chunks: nothing protects them
        self.latest_loose: Messages | None = None
        self.chunks = 0
        self.ended = False  # the record DataEnd was found
        self.checksum, self.data_end = 0, 0  # of the data, 0: none; byte after them
        self.strange: Counter[int] = Counter()  # opcode -> records of a kind that is not known
        self.summary = read_summary(data)
        self.end = self.summary.start if self.summary else len(data)

    def walk(self) -> None:
        """Read all records before the summary, then settle what is known of them."""
        position: int | None = len(MCAP0_MAGIC)
        if self.data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
            self.lost.append("the file does not start like MCAP")
            position = self.nonsense(0)
        while position is not None and position < self.end:
            position = self.step(position)
        summary = self.summary
        if summary is not None and summary.sure:
            self.schemas |= summary.schemas
            self.channels |= summary.channels
        elif summary is not None:
            self.schemas = summary.schemas | self.schemas
            self.channels = summary.channels | self.channels
        self._settle_loose()
        self.contents.topics = dict(topics_of(self.channels, self.schemas))
        self.contents.drop_undefined()
        if not self.ended and summary is None and not self.lost:
            self.lost.append("no whole message, but the file ends before its index")
        elif self.ended and summary is None and (another := another_file(self.data, self.data_end)):
            self.lost.append(f"another MCAP file begins at byte {another}; it is left out")
        elif (not self.ended or summary is None) and not self.lost:
            self.contents.notes.append("the index is cut off or damaged; no message is lost")
        self._compare()

    def _compare(self) -> None:
        """Compare what was read with the statistics and with the checksum of the data."""
        compare_statistics(self.contents, self.summary, self.strange)
        if (
            self.checksum
            and self.loose
            and not self.lost
            and not checksum_holds(self.data, self.data_end, self.checksum)
        ):
            self.lost.append(
                "the checksum of its data does not hold; a message is changed, and no other sign says which"
            )

    def step(self, position: int) -> int | None:
        """Read the record at `position`; where the next one is, None at the end."""
        data, body = self.data, position + HEAD.size
        if position >= self.content_end:
            self.lost.append(f"{self.end - position} zero bytes from byte {position} to the end")
            return None
        if body > self.end:
            self.lost.append(f"{self.end - position} bytes of a record cut at byte {position}")
            return None
        opcode, length = HEAD.unpack_from(data, position)
        if opcode == Opcode.CHUNK:
            return self.chunk(position, length)
        if body + length > self.end or not opcode:
            return self.nonsense(position)
        following = int(body + length)
        if opcode not in OPCODES:
            if opcode < PRIVATE and not begins_record(self.data, following, self.end):
                return self.nonsense(position)
            self.strange[opcode] += 1
            return following
        if opcode == Opcode.MESSAGE:
            return self.loose_message(position, following)
        try:
            self.take(opcode, data[body:following], begins_record(self.data, following, self.end))
        except DAMAGE:
            return self.nonsense(position)
        self.data_end = position
        return None if self.ended else following

    def take(self, opcode: int, body: bytes, extended: bool) -> None:
        """Take one record that is no message; one of DAMAGE if it makes no sense. `extended`: its length is sure."""
        if opcode in RECORDS:
            record = whole_record(RECORDS[opcode], body, extended)
            if isinstance(record, Metadata):
                self.metadata(record)
            elif isinstance(record, Schema):
                self.schemas[record.id] = record
            else:
                self.define(record)
            return
        check_length(opcode, body, extended)
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            self.ended = True
            self.checksum = struct.unpack_from("<I", body)[0] if opcode == Opcode.DATA_END else 0

    def metadata(self, record: Metadata) -> None:
        if record.name in CUSTOM_NAMES:
            self.contents.custom.update(record.metadata)
        elif record.name == ROSBAG2_NAME:
            self.contents.metadata = record.metadata.get("serialized_metadata", "")

    def define(self, channel: Channel) -> None:
        self.channels[channel.id] = channel
        for found in topics_of({channel.id: channel}, self.schemas):
            self.kept[channel.id] = self.keep(found[1])

    def loose_message(self, position: int, following: int) -> int | None:
        """Take a message outside of chunks, as writers without chunks leave them."""
        if following - position < MESSAGE_HEAD.size:
            return self.nonsense(position)
        _, _, channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(self.data, position)
        raw = bytes(self.data[position + MESSAGE_HEAD.size : following])
        self.latest_loose = messages = self.loose.setdefault(channel, Messages())
        if following > self.content_end and not ends_like_others(raw, messages.raws):
            self.lost.append(f"the message at byte {position}, which reaches into zeros")
        else:
            messages.add(time_ns, raw)
        return following

    def nonsense(self, position: int) -> int | None:
        """Go on at the next whole chunk after bytes that make no sense."""
        latest = self.latest_loose
        if latest and latest.raws and len(latest.raws[-1]) not in map(len, latest.raws[:-1]):
            latest.raws.pop()  # its length may be what is damaged
            latest.times.pop()
            self.lost.append(f"the message before byte {position}, which may be damaged")
        if latest and latest.raws and filled(latest.raws[-1], self.data, position):
            latest.raws.pop()
            latest.times.pop()
            self.lost.append(
                f"the message before byte {position}, which reaches into empty storage"
            )
        for found in CHUNK_START.finditer(self.data, position + 1, self.end):
            if whole_chunk(self.data, found.start(), self.end, self.content_end) is not None:
                gap = found.start() - position
                self.lost.append(f"{gap} bytes from byte {position} on make no sense")
                return found.start()
        self.lost.append(f"{self.end - position} bytes from byte {position} on make no sense")
        return None

    def chunk(self, position: int, length: int) -> int | None:
        """Take the records of a chunk; where the next record is."""
        self.chunks += 1
        whole = whole_chunk(self.data, position, self.end, self.content_end)
        if whole is not None:
            records, following = whole
            self.records(records, len(records), whole=True)
            end = position + HEAD.size + length
            extended = following < end <= self.end and not begins_record(
                self.data, following, self.end
            )
            return end if extended and begins_record(self.data, end, self.end) else following
        head = chunk_head(self.data, position, self.content_end)
        if head is None or head.end - position - HEAD.size != length:
            if position + HEAD.size + length > self.content_end:
                self.lost.append(f"the chunk at byte {position}, of which only the head is left")
                return None
            return self.nonsense(position)
        if head.compression not in COMPRESSIONS:
            name = repr(head.compression)
            self.lost.append(
                f"chunk at byte {position} is compressed as {name}, which is not known; left out"
            )
            return head.end
        if head.end <= self.content_end:
            self.lost.append(f"chunk at byte {position} is damaged (wrong checksum); left out")
            return head.end
        before = self.contents.count
        self.records(*cut_chunk(self.data, head, self.content_end))
        saved = self.contents.count - before
        self.lost.append(
            f"the chunk at byte {position} is cut; its first {saved} messages are saved, the rest is lost"
        )
        return head.end

    def records(self, data: bytes, content_end: int, whole: bool = False) -> None:
        """Take the records of a chunk as far as they are whole; all are where the chunk is."""
        position, end = 0, len(data)
        data += bytes(MESSAGE_HEAD.size)  # so that the head of a short last record can be unpacked
        kept, messages, unpack_head = self.kept, self.contents.messages, MESSAGE_HEAD.unpack_from
        while position + HEAD.size <= end:
            opcode, length, channel, _, time_ns, _ = unpack_head(data, position)
            following = position + HEAD.size + length
            if following > end:
                return
            if opcode == MESSAGE:
                size = kept.get(channel)
                start = position + MESSAGE_HEAD.size
                raw = data[start : following if size is None else min(following, start + size)]
                found = messages.get(channel)
                if found is None:
                    found = messages[channel] = Messages()
                if following > content_end and not ends_like_others(raw, found.raws):
                    return
                found.times.append(time_ns)
                found.raws.append(raw)
            elif opcode == 0 or following > content_end:
                return
            elif opcode not in OPCODES:
                self.strange[opcode] += 1
            else:
                try:
                    self.take(opcode, data[position + HEAD.size : following], whole)
                except DAMAGE:
                    return
            position = following

    def _settle_loose(self) -> None:
        """Messages outside of chunks: kept unless the file has chunks and is damaged."""
        count = sum(map(len, self.loose.values()))
        if count and self.chunks and self.lost:
            self.lost.append(f"{count} messages outside of chunks, which no checksum protects")
            return
        for channel, found in self.loose.items():
            size, have = (
                self.kept.get(channel),
                self.contents.messages.setdefault(channel, Messages()),
            )
            have.times += found.times
            have.raws += found.raws if size is None else [raw[:size] for raw in found.raws]
