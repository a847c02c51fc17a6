# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a damaged sqlite3 recording, read from its pages one by one without the tree that joins them.

A table's rows stand in leaf pages. rosbag2 never changes or deletes a row, so that every row in any leaf page is one.
Nothing in this format has a checksum: a changed byte in a message stays unseen.
Source: sqlite.org/fileformat2.html.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fish_bag.storage import Buffer

LEAF = 0x0D  # type of a page with rows of a table
FILE_HEAD_BYTES = 100
USUAL_PAGE = 4096
NEAR_PAGES = 64  # before a place, in which rows that reach there are looked for
INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}  # serial type -> bytes
Value = int | str | bytes | None


@dataclass(frozen=True)
class Gaps:
    """Bytes of a database that damage has taken.

    Attributes:
        holes: what no file holds; a row that reaches there is no row.
        zeros: the zeros at the end of what is there; they may be a row's own.
    """

    holes: Sequence[range] = ()
    zeros: Sequence[range] = ()


@dataclass(frozen=True)
class Row:
    """One row: its number, its columns, whether it reaches into a gap's zeros, and whether zeros follow it in its page."""

    number: int
    values: tuple[Value, ...]
    in_zeros: bool
    zeros_follow: (
        bool  # packed rows do not leave room, so that the row's end may be zeros by damage
    )


NO_GAPS = Gaps()


def rows(data: Buffer, near: int | None = None, gaps: Gaps = NO_GAPS) -> Iterator[Row]:
    """All rows that are whole, or those in the pages up to byte `near`, in order of their place in the file.

    Args:
        data: the file.
        near: the byte up to which pages are read, None for all.
        gaps: what of the file is not to be trusted.
    """
    page_bytes = int.from_bytes(data[16:18], "big")
    page_bytes = 65536 if page_bytes == 1 else page_bytes
    if page_bytes < 512 or page_bytes & (page_bytes - 1):
        page_bytes = USUAL_PAGE
    usable = page_bytes - data[20] if len(data) > 20 and data[20] < page_bytes - 480 else page_bytes
    starts = range(0, len(data), page_bytes)
    if near is not None:
        last = near // page_bytes
        starts = starts[max(0, last - NEAR_PAGES) : last + 1]
    for start in starts:
        yield from _page(data, start, page_bytes, usable, gaps)


def _page(data: Buffer, start: int, page_bytes: int, usable: int, gaps: Gaps) -> Iterator[Row]:
    head = start + (FILE_HEAD_BYTES if start == 0 else 0)
    if head + 8 > len(data) or data[head] != LEAF:
        return
    count = int.from_bytes(data[head + 3 : head + 5], "big")
    for k in range(min(count, usable // 4)):
        place = int.from_bytes(data[head + 8 + 2 * k : head + 10 + 2 * k], "big")
        if not 8 + 2 * count <= place < usable:
            continue
        try:
            row = _row(data, start + place, start + usable, page_bytes, usable, gaps)
        except (IndexError, ValueError, struct.error):  # UnicodeDecodeError is a ValueError
            continue
        if row is not None:
            yield row


def _row(
    data: Buffer, at: int, page_end: int, page_bytes: int, usable: int, gaps: Gaps
) -> Row | None:
    """The row at byte `at`, None where a part of it is missing."""
    size, at = _varint(data, at)
    number, at = _varint(data, at)
    local, longest = size, usable - 35
    if size > longest:
        least = (usable - 12) * 32 // 255 - 23
        local = least + (size - least) % (usable - 4)
        local = local if local <= longest else least
    end = at + local
    if size <= 0 or end > page_end or end > len(data) or _meets(at, end, gaps.holes):
        return None
    payload, in_zeros = bytes(data[at:end]), _meets(at, end, gaps.zeros)
    following = int.from_bytes(data[end : end + 4], "big") if local < size else 0
    zeros_follow = local == size and end < len(data) and not any(data[end : end + 2])
    while len(payload) < size:
        page = (following - 1) * page_bytes
        take = min(size - len(payload), usable - 4)
        last = page + 4 + take
        if page <= 0 or last > len(data) or _meets(page, last, gaps.holes):
            return None
        following = int.from_bytes(data[page : page + 4], "big")
        payload += bytes(data[page + 4 : last])
        in_zeros = in_zeros or _meets(page, last, gaps.zeros)
    values = _values(payload)
    return None if values is None else Row(number, values, in_zeros, zeros_follow)


def _meets(start: int, end: int, parts: Sequence[range]) -> bool:
    return any(part.start < end and start < part.stop for part in parts)


def _values(payload: bytes) -> tuple[Value, ...] | None:
    """Columns of a record; None where their lengths do not add up to its length."""
    head_bytes, at = _varint(payload, 0)
    kinds = []
    while at < head_bytes:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    if at != head_bytes:
        return None
    values: list[Value] = []
    for kind in kinds:
        size = INTEGER_BYTES.get(kind, (kind - 12) // 2 if kind >= 12 else 0)
        piece = payload[at : at + size]
        if kind in (7, 10, 11) or len(piece) < size:  # rosbag2 has no column of floats
            return None
        if kind >= 12:
            values.append(piece.decode() if kind % 2 else piece)
        elif kind == 0:
            values.append(None)
        else:
            values.append(kind - 8 if kind in (8, 9) else int.from_bytes(piece, "big", signed=True))
        at += size
    return tuple(values) if at == len(payload) else None


def _varint(data: Buffer, at: int) -> tuple[int, int]:
    """A number of one to nine bytes and the byte after it."""
    value = 0
    for k in range(8):
        byte = data[at + k]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + k + 1
    return value << 8 | data[at + 8], at + 9
