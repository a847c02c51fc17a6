# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the fields of a serialised message lie, and decoding of many messages of one layout at once.

Messages of one topic nearly always have the same size, the same strings and the same sequence lengths; only
numbers change. So the fields are located once, in the first message, by walking its type definition (CDR as
in OMG DDSI-RTPS 10.5 with the alignment rules of XCDR1; ROS 1 serialisation without alignment), and all
messages that agree with it in every structural byte are decoded as one numpy array. The others form layouts
of their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict

DTYPES = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
# per topic; more means that lengths change with every message and columns make no sense
MAX_LAYOUTS = 200
# fields that a walk visits without coming further: types without fields may name each other without end
MOST_EMPTY = 10_000
DEEPEST = 100  # types within types


class LayoutError(Exception):
    """The bytes do not fit the message type."""


@dataclass(frozen=True)
class Column:
    """A number or an array of numbers at a fixed place: `count` None is a scalar."""

    path: str  # "header.stamp.sec", "position"
    offset: int  # bytes from the start of the raw message
    dtype: np.dtype
    count: int | None

    @property
    def nbytes(self) -> int:
        return self.dtype.itemsize * (1 if self.count is None else self.count)


@dataclass
class Layout:
    """All columns and strings of one message."""

    columns: list[Column] = field(default_factory=list)
    texts: dict[str, list[str]] = field(
        default_factory=dict
    )  # path -> strings (one for a plain string)
    fixed: list[int] = field(
        default_factory=list
    )  # bytes that decide the layout: lengths and strings
    size: int = 0


class _Walker:
    """One walk over one raw message, collecting columns and strings."""

    def __init__(self, raw: bytes, types: Typesdict, ros1: bool) -> None:
        self.raw, self.types, self.ros1 = raw, types, ros1
        self.base = 0 if ros1 else 4  # CDR aligns relative to the end of the encapsulation header
        if not ros1 and (len(raw) < 4 or raw[0] != 0 or raw[1] > 1):
            raise LayoutError(
                f"{len(raw)} bytes without a CDR header: {raw[:4].hex() or 'nothing'}"
            )
        self.order = "<" if ros1 or raw[1] else ">"
        self.pos = self.base
        self.reached, self.empty, self.depth = self.base, 0, 0
        self.layout = Layout(fixed=list(range(self.base)))

    def message(self, msgtype: str, prefix: str) -> None:
        if msgtype not in self.types:
            raise LayoutError(f"the recording does not define message type {msgtype}")
        self.depth += 1
        for name, desc in self.types[msgtype][1]:
            self.item(desc, f"{prefix}{name}")
        self.depth -= 1

    def item(self, desc: Any, path: str) -> None:
        kind, what = desc
        self.empty = 0 if self.pos > self.reached else self.empty + 1
        self.reached = self.pos
        if self.empty > MOST_EMPTY or self.depth > DEEPEST:
            raise LayoutError(f"the type of field {path[:60]} has no end or no fields")
        if kind == Nodetype.NAME:
            self.message(what, f"{path}.")
        elif kind == Nodetype.BASE and what[0] == "string":
            self.layout.texts.setdefault(path, []).append(self.string())
        elif kind == Nodetype.BASE:
            self.numbers(what[0], path, None)
        elif kind == Nodetype.ARRAY:
            self.elements(what[0], path, what[1])
        else:
            self.elements(what[0], path, self.length())

    def elements(self, desc: Any, path: str, count: int) -> None:
        kind, what = desc
        if kind == Nodetype.BASE and what[0] != "string":
            self.numbers(what[0], path, count)
            return
        if kind == Nodetype.BASE:
            self.layout.texts.setdefault(path, [])
        for i in range(count):
            self.item(desc, path if kind == Nodetype.BASE else f"{path}.{i}")

    def numbers(self, base: str, path: str, count: int | None) -> None:
        if base not in DTYPES:
            raise LayoutError(f"field {path} of type {base} is not supported")
        dtype = np.dtype(self.order + DTYPES[base])
        if count != 0:
            self.align(dtype.itemsize)
        column = Column(path, self.pos, dtype, count)
        self.layout.columns.append(column)
        self.advance(column.nbytes)

    def length(self) -> int:
        self.align(4)
        start = self.pos
        self.advance(4)
        self.layout.fixed.extend(range(start, self.pos))
        return int.from_bytes(self.raw[start : self.pos], "little" if self.order == "<" else "big")

    def string(self) -> str:
        length = self.length()
        start = self.pos
        self.advance(length)
        self.layout.fixed.extend(range(start, self.pos))
        return self.raw[start : self.pos].rstrip(b"\0").decode(errors="replace")

    def align(self, size: int) -> None:
        if not self.ros1:
            self.pos += -(self.pos - self.base) % size

    def advance(self, size: int) -> None:
        self.pos += size
        if self.pos > len(self.raw):
            raise LayoutError(f"message ends after {len(self.raw)} bytes, its fields need more")


def find_layout(raw: bytes, msgtype: str, types: Typesdict, ros1: bool) -> Layout:
    """Locate every field of one raw message; LayoutError if the bytes do not fit the type."""
    walker = _Walker(raw, types, ros1)
    walker.message(msgtype, "")
    if len(raw) - walker.pos > 3:  # up to 3 bytes of padding are usual
        raise LayoutError(f"message has {len(raw)} bytes, its fields only {walker.pos}")
    walker.layout.size = len(raw)
    return walker.layout


@dataclass(frozen=True)
class Block:
    """Messages of one layout, decoded."""

    index: np.ndarray  # (n,) positions among the messages given
    values: dict[str, np.ndarray]  # path -> (n,) scalar fields, (n, count) array fields
    texts: dict[str, list[str]]  # path -> strings, the same in all n messages


def decode_blocks(
    raws: list[bytes], msgtype: str, types: Typesdict, ros1: bool = False
) -> tuple[list[Block], np.ndarray]:
    """Decode messages of one type.

    Returns:
        blocks, and the positions of messages in no block: their bytes do not fit the type, or MAX_LAYOUTS
        others came before their layout.
    """
    sizes = np.fromiter(map(len, raws), int, len(raws))
    left = np.ones(len(raws), bool)
    bad: list[int] = []
    blocks: list[Block] = []
    while left.any():
        first = int(np.argmax(left))
        left[first] = False
        if len(blocks) == MAX_LAYOUTS:
            bad += [first, *np.flatnonzero(left).tolist()]
            break
        try:
            layout = find_layout(raws[first], msgtype, types, ros1)
        except LayoutError:
            bad.append(first)
            continue
        alike = np.flatnonzero(left & (sizes == layout.size))
        index, rows = _same_structure(raws, first, alike, layout)
        left[index] = False
        blocks.append(Block(index, dict(_columns(rows, layout)), layout.texts))
    return blocks, np.array(bad, int)


def _same_structure(
    raws: list[bytes], first: int, alike: np.ndarray, layout: Layout
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and bytes (n, size) of the messages that differ from raws[first] in numbers only."""
    index = np.concatenate([[first], alike])
    rows = np.frombuffer(b"".join([raws[i] for i in index]), np.uint8).reshape(
        len(index), layout.size
    )
    same = (rows[:, layout.fixed] == rows[0, layout.fixed]).all(axis=1)
    return (index, rows) if same.all() else (index[same], rows[same])


def _columns(rows: np.ndarray, layout: Layout) -> Iterator[tuple[str, np.ndarray]]:
    """Path and array of every column; arrays are copies in native byte order."""
    for column in layout.columns:
        raw = np.ascontiguousarray(rows[:, column.offset : column.offset + column.nbytes])
        values = raw.view(column.dtype) if column.nbytes else np.empty((len(rows), 0), column.dtype)
        values = values.astype(column.dtype.newbyteorder("="), copy=False)
        yield column.path, values[:, 0] if column.count is None else values
