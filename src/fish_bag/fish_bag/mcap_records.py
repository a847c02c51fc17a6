# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records, chunks and summary of an MCAP file, as the mcap package reads them, with the checks that it leaves out.

Source: MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from fish_bag.message_types import ros2_type_name
from fish_bag.storage import PACKING_DAMAGE, Buffer, Contents, StoredTopic, unpack

HEAD = struct.Struct("<BQ")  # opcode, length
FOOTER_BYTES = HEAD.size + 20
OPCODES = frozenset(Opcode)
MOST_STRANGE = 1000  # records of unknown kinds, one after another
OF_DATA = frozenset(
    {
        *(Opcode.HEADER, Opcode.FOOTER, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX),
        *(Opcode.ATTACHMENT, Opcode.METADATA, Opcode.DATA_END),
    }
)  # records that no summary has
DAMAGE = (McapError, struct.error, ValueError)  # of parsing a damaged record
CHUNK_HEAD = struct.Struct(
    "<QQQII"
)  # first and last time, unpacked size, checksum, length of the name
LONGEST_NAME = 16  # of a compression
CHUNK_START = re.compile(
    rb"\x06.{36}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd)", re.DOTALL
)
PRIVATE = 0x80  # from here on opcodes of applications


@dataclass
class Summary:
    """The summary section of a file that was closed."""

    start: int  # byte
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None  # channel -> messages; None: not said
    total: int | None = None  # messages; None: not said
    sure: bool = False  # it has a checksum, which holds


class _WholeReads(BytesIO):
    """Bytes of which a read gives all that was asked for; the mcap package takes less without a word."""

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        if size is not None and len(data) < size:
            raise ValueError(f"{size - len(data)} bytes are missing")
        return data


def topics_of(
    channels: dict[int, Channel], schemas: dict[int, Schema]
) -> Iterator[tuple[int, StoredTopic]]:
    """The channels; the type is "" where the file does not say it."""
    for channel in channels.values():
        schema = schemas.get(channel.schema_id)  # None: it has none, or its record is lost
        name, encoding, definition = (
            (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        )
        qos = channel.metadata.get("offered_qos_profiles", "")
        yield (
            channel.id,
            StoredTopic(
                channel.topic,
                ros2_type_name(name),
                channel.message_encoding,
                definition,
                encoding,
                qos,
            ),
        )


def whole_record(kind: type[Any], body: bytes, extended: bool = False) -> Any:
    """Parse a record that fills its body to the last byte.

    Args:
        extended: fields of a later MCAP version may follow; the specification has readers ignore them.
    """
    stream = ReadDataStream(_WholeReads(body))
    record = kind.read(stream)
    if stream.count != len(body) and not extended:
        raise ValueError(f"{len(body) - stream.count} bytes too many")
    return record


def begins_record(data: Buffer, position: int, end: int) -> bool:
    """Whether a record of a known kind that fits into the file begins there, also after some of unknown kinds."""
    for _ in range(MOST_STRANGE):
        if position + HEAD.size > end:
            return position == end
        opcode, length = HEAD.unpack_from(data, position)
        position += HEAD.size + length
        if opcode in OPCODES or not opcode or position > end:
            return opcode in OPCODES and position <= end
    return False


def read_summary(data: Buffer) -> Summary | None:
    """The summary section; None where there is none or where it is damaged."""
    footer_at = len(data) - len(MCAP0_MAGIC) - FOOTER_BYTES
    if footer_at < len(MCAP0_MAGIC) or data[-len(MCAP0_MAGIC) :] != MCAP0_MAGIC:
        return None
    if HEAD.unpack_from(data, footer_at) != (Opcode.FOOTER, 20):
        return None
    footer = Footer.read(ReadDataStream(BytesIO(data[footer_at + HEAD.size :])))
    start, checksum = footer.summary_start, footer.summary_crc
    if not start:
        return Summary(footer_at)
    if not len(MCAP0_MAGIC) <= start <= footer_at:
        return None
    covered = bytes(data[start : footer_at + FOOTER_BYTES - 4])  # all but the checksum itself
    if checksum and zlib.crc32(covered) != checksum:
        return None
    summary = Summary(start, sure=bool(checksum))
    position = start
    try:
        while position < footer_at:
            opcode, length = HEAD.unpack_from(data, position)
            following = position + HEAD.size + length
            _take_summary(summary, opcode, data[position + HEAD.size : following])
            position = following
    except DAMAGE:
        return None  # only where the writer left out the checksum
    return summary if position == footer_at else None


def _take_summary(summary: Summary, opcode: int, body: bytes) -> None:
    if opcode in OF_DATA:
        raise ValueError("the summary begins inside the data")
    if opcode == Opcode.SCHEMA:
        schema = whole_record(Schema, body, summary.sure)
        summary.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = whole_record(Channel, body, summary.sure)
        summary.channels[channel.id] = channel
    elif opcode == Opcode.STATISTICS:
        statistics = whole_record(Statistics, body, summary.sure)
        summary.total = statistics.message_count
        if not statistics.message_count or statistics.channel_message_counts:
            summary.counts = statistics.channel_message_counts


def check_length(opcode: int, body: bytes, extended: bool) -> None:
    """ValueError where the length of a record that is not parsed is wrong; `extended` as in `whole_record`."""
    least = {Opcode.DATA_END: 4, Opcode.FOOTER: 20, Opcode.MESSAGE_INDEX: 6}.get(Opcode(opcode))
    if least == 6 and len(body) >= 6:
        least += struct.unpack_from("<I", body, 2)[0]
    if least is not None and (len(body) < least or (len(body) > least and not extended)):
        raise ValueError("wrong length")


def checksum_holds(data: Buffer, data_end: int, checksum: int) -> bool:
    """Whether the checksum of the data holds; writers begin it at the file, after the magic, or after the header."""
    _, length = HEAD.unpack_from(data, len(MCAP0_MAGIC))
    starts = (0, len(MCAP0_MAGIC), len(MCAP0_MAGIC) + HEAD.size + length)
    return any(zlib.crc32(data[k:data_end]) == checksum for k in starts)


def another_file(data: Buffer, after: int) -> int:
    """The byte from `after` on at which a second file begins, as joining two files leaves it; 0: none."""
    return max(0, data.find(MCAP0_MAGIC + bytes([Opcode.HEADER]), after))


@dataclass(frozen=True)
class ChunkHead:
    """What a chunk says of itself."""

    compression: str
    size: int  # unpacked
    checksum: int  # of the unpacked records, 0: none
    body: int  # byte at which the packed records begin
    end: int  # byte after them


def chunk_head(data: Buffer, position: int, content_end: int) -> ChunkHead | None:
    """The head of the chunk at `position`, None where it is cut or makes no sense."""
    start = position + HEAD.size
    if start + CHUNK_HEAD.size > content_end:
        return None
    _, _, size, checksum, name_length = CHUNK_HEAD.unpack_from(data, start)
    body = start + CHUNK_HEAD.size + name_length + 8
    if name_length > LONGEST_NAME or body > content_end:
        return None
    name = bytes(data[body - 8 - name_length : body - 8]).decode(errors="replace")
    (packed,) = struct.unpack_from("<Q", data, body - 8)
    return ChunkHead(name, size, checksum, body, body + packed)


def whole_chunk(
    data: Buffer, position: int, end: int, content_end: int
) -> tuple[bytes, int] | None:
    """Records of the chunk at `position` and where the next record is; None if the chunk is not whole.

    The length stands in the chunk twice. Either is tried, and the checksum decides.

    Args:
        end: byte at which the data section ends at the latest.
        content_end: byte after which there are only zeros.
    """
    head = chunk_head(data, position, content_end)
    if head is None:
        return None
    _, length = HEAD.unpack_from(data, position)
    for chunk_end in dict.fromkeys((head.end, position + HEAD.size + length)):
        if not head.body <= chunk_end <= end:
            continue
        try:
            records, _ = unpack(head.compression, bytes(data[head.body : chunk_end]), head.size)
        except PACKING_DAMAGE:
            continue
        if head.checksum:
            sure = zlib.crc32(records) == head.checksum
        else:  # the writer gave none
            sure = len(records) == head.size and chunk_end <= content_end
        if sure:
            return records, chunk_end
    return None


def cut_chunk(data: Buffer, head: ChunkHead, content_end: int) -> tuple[bytes, int]:
    """What is left of the records of a chunk that is cut, and after how many bytes only zeros follow."""
    if not head.compression:
        return bytes(data[head.body : head.end]), content_end - head.body
    try:
        records, _ = unpack(head.compression, bytes(data[head.body : content_end]), head.size)
    except PACKING_DAMAGE:
        return b"", 0
    return records, len(records)


def compare_statistics(contents: Contents, summary: Summary | None, strange: Counter[int]) -> None:
    """Say every difference in `contents`.

    Args:
        summary: of the file, None without one.
        strange: opcode -> records of a kind that is not known.
    """
    counts, total = (summary.counts, summary.total) if summary else (None, None)
    if counts is not None:
        contents.compare_counts(counts, "its statistics")
    agree = counts == {c: len(m) for c, m in contents.messages.items() if len(m)}
    if total not in (None, contents.count) and (counts is None or agree):
        contents.notes.append(
            f"{contents.count} messages are in the file, its statistics say {total}"
        )
    if strange:
        kinds = ", ".join(f"{opcode:#04x} ({n})" for opcode, n in sorted(strange.items()))
        said = contents.notes if agree or min(strange) >= PRIVATE else contents.lost
        said.append(f"records of kinds that MCAP does not define: {kinds}; they are left out")
