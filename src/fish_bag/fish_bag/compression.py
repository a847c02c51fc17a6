# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compression of recordings, known by its first bytes: of a whole file, a chunk, or a single message."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from typing import Any

import lz4.frame
import zstandard

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # no serialised message begins like this: CDR begins with a zero
LZ4_MAGIC = b"\x04\x22\x4d\x18"
KNOWN = ("", "none", "zstd", "lz4", "bz2")  # names of compressions; the first two are none
DAMAGE = (zstandard.ZstdError, RuntimeError, MemoryError, OSError, EOFError, ValueError)


def _decompressor(name: str) -> Any:
    if name == "zstd":
        return zstandard.ZstdDecompressor().decompressobj()
    if name == "lz4":
        return lz4.frame.LZ4FrameDecompressor()
    if name == "bz2":
        return BZ2Decompressor()
    raise ValueError(f"compression {name!r} is not known; expected zstd, lz4, bz2 or none")


def unpack(name: str, packed: bytes) -> tuple[bytes, bool]:
    """Unpack all that there is, also where the end is cut off, and whether it is whole.

    Args:
        name: "zstd", "lz4", "bz2", or "" or "none" for data that are not packed.

    Raises:
        one of DAMAGE: the bytes make no sense, or the compression is unknown.
    """
    if name in KNOWN[:2]:
        return packed, True
    parts = []
    while packed:
        decompressor = _decompressor(name)
        parts.append(bytes(decompressor.decompress(packed)))
        if not decompressor.eof:
            return b"".join(parts), False
        packed = decompressor.unused_data or b""
    return b"".join(parts), True


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
    except DAMAGE:
        return None
    return data if whole else None
