# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The write-ahead log of a sqlite3 recording: which of its pages are whole, and what damage has taken.

sqlite3 stops without a word at the first page of the log that is damaged, and before it at the latest commit.
Source: sqlite.org/fileformat2.html, section 4.
"""

from __future__ import annotations

import struct
import sys
from array import array
from dataclasses import dataclass, field

from fish_bag.recording_files import LFS_MAGIC
from fish_bag.sqlite_pages import Gaps
from fish_bag.storage import end_of_content

HEAD = struct.Struct(
    ">IIIIIIII"
)  # magic, version, page size, number, salts 1 and 2, checksums 1 and 2
FRAME = struct.Struct(
    ">IIIIII"
)  # page, pages after a commit (0: none), salts 1 and 2, checksums 1 and 2
MAGICS = {0x377F0682: "little", 0x377F0683: "big"}  # byte order of the checksums
RESETS = 1 << 16  # salt 1 grows by one whenever sqlite3 begins the log anew
Sums = tuple[int, int]


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
