# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A chunk of an MCAP file: whether it is whole, and what is left of it where it is cut.

Source: MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass

from fish_bag.compression import DAMAGE as PACKING_DAMAGE
from fish_bag.compression import unpack
from fish_bag.mcap_records import HEAD
from fish_bag.storage import Buffer

CHUNK_HEAD = struct.Struct(
    "<QQQII"
)  # first and last time, unpacked size, checksum, length of the name
LONGEST_NAME = 16  # of a compression
CHUNK_START = re.compile(
    rb"\x06.{36}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd)", re.DOTALL
)


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
            records, _ = unpack(head.compression, bytes(data[head.body : chunk_end]))
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
        records, _ = unpack(head.compression, bytes(data[head.body : content_end]))
    except PACKING_DAMAGE:
        return b"", 0
    return records, len(records)
