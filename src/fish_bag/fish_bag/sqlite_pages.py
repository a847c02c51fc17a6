# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pages of a damaged sqlite3 recording and of its write-ahead log, read one by one without the tree that joins them.

A table's rows stand in leaf pages. rosbag2 never changes or deletes a row, so that every row in any leaf page is one.
Nothing in this format but the log has a checksum: a changed byte in a message stays unseen. sqlite3 stops without a word at
the first page of the log that is damaged, and before it at the latest commit.
Source: sqlite.org/fileformat2.html.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fish_bag.recording_files import LFS_MAGIC
from fish_bag.storage import Buffer, end_of_content

LEAF = 0x0D  # type of a page with rows of a table
FILE_HEAD_BYTES = 100
USUAL_PAGE = 4096
NEAR_PAGES = 64  # before a place, in which rows that reach there are looked for
INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}  # serial type -> bytes
Value = int | str | bytes | None
HEAD = struct.Struct(
    ">IIIIIIII"
)  # magic, version, page size, number, salts 1 and 2, checksums 1 and 2
FRAME = struct.Struct(
    ">IIIIII"
)  # page, pages after a commit (0: none), salts 1 and 2, checksums 1 and 2
MAGICS = {0x377F0682: "little", 0x377F0683: "big"}  # byte order of the checksums
RESETS = 1 << 16  # salt 1 grows by one whenever sqlite3 begins the log anew
Sums = tuple[int, int]


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


@dataclass
class Log:
    """The pages of a log from its beginning to the first that is damaged."""

    page_bytes: int = 0
    pages: list[tuple[int, bytes]] = field(default_factory=list)  # number from 1, content
    committed_pages: int = 0  # of the database after the last commit, 0 without one
    lost: str = ""  # what cannot be read, "" where the log is whole

    def applied(self, database: bytes) -> tuple[bytes, Gaps]:
        """The database with all pages of the log, those without a commit too, and what neither of them holds."""
        if not self.page_bytes:  # its head cannot be read
            return database, Gaps()
        size, data = self.page_bytes, bytearray(database)
        for number, page in self.pages:
            end = number * size
            data.extend(bytes(max(0, end - len(data))))
            data[end - size : end] = page
        written = {number for number, _ in self.pages}
        own = [
            range(end - size, end)
            for end in range(size, len(data) + 1, size)
            if end // size not in written
        ]
        content, length = end_of_content(database), len(database)
        return bytes(data), Gaps(
            holes=[range(max(page.start, length), page.stop) for page in own if page.stop > length],
            zeros=[
                range(max(page.start, content), min(page.stop, length))
                for page in own
                if page.stop > content and page.start < length
            ],
        )

    def missing_pages(self, database_bytes: int) -> int:
        """How many pages of the last commit stand neither in the database of that size nor in the log."""
        if not self.committed_pages:
            return 0
        asked = range(database_bytes // self.page_bytes + 1, self.committed_pages + 1)
        return len(set(asked) - {number for number, _ in self.pages})


def read_log(data: bytes) -> Log:
    """Read a `-wal` file page by page."""
    if data.startswith(LFS_MAGIC):
        return Log(lost="it is a Git LFS pointer; 'git lfs pull' brings the log")
    if len(data) < HEAD.size:
        return Log(lost="its head is cut")
    magic, _, page_bytes, _, *salts, first, second = HEAD.unpack_from(data)
    order = MAGICS.get(magic, "")
    sums = _checksum(data[: HEAD.size - 8], order or "big", (0, 0))
    if not order or sums != (first, second):
        return Log(lost="its head is damaged")
    log, position, committed = Log(page_bytes), HEAD.size, HEAD.size
    while position + FRAME.size + page_bytes <= len(data):
        number, commit, *found, first, second = FRAME.unpack_from(data, position)
        end = position + FRAME.size + page_bytes
        page = data[position + FRAME.size : end]
        sums = _checksum(data[position : position + 8] + page, order, sums)
        if found != salts or sums != (first, second) or not number:
            break
        log.pages.append((number, page))
        log.committed_pages = commit or log.committed_pages
        position, committed = end, end if commit else committed
    rest = len(data) - position
    if rest and not _is_old(data, position, salts[0]):
        log.lost = f"{rest} bytes from byte {position} on are damaged"
    elif committed < position:
        log.lost = f"the recorder had not finished what begins at byte {committed}"
    return log


def _is_old(data: bytes, position: int, salt: int) -> bool:
    """Whether a page is of an earlier round of the log, as sqlite3 leaves them behind."""
    if position + FRAME.size > len(data):
        return False
    number, _, found, *_ = FRAME.unpack_from(data, position)
    return bool(number) and 0 < (salt - found) % 2**32 < RESETS


def _checksum(data: bytes, order: str, sums: Sums) -> Sums:
    """The running checksum after `data`, whose length is a multiple of 8."""
    words = array("I", data)
    if order != sys.byteorder:
        words.byteswap()
    first, second = sums
    for k in range(0, len(words), 2):
        first = (first + words[k] + second) & 0xFFFFFFFF
        second = (second + words[k + 1] + first) & 0xFFFFFFFF
    return first, second
