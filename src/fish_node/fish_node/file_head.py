# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the first bytes of a file or picture say: that it is another thing than its name says, or how large it unpacks.

A few bytes may say a size that fills the memory when the picture is unpacked.
"""

from __future__ import annotations

MAGICS = {
    b"version https://git-lfs": "a Git LFS pointer; 'git lfs pull' brings the file",
    b"\x1f\x8b": "compressed by gzip; gunzip it",
    b"PK\3\4": "a zip archive; unzip it",
    b"(\xb5/\xfd": "compressed by zstd; unzstd it",
}  # first bytes -> what the file is, and what to do
LARGEST_SIDE = 8192  # pixels; a larger picture is none of a camera over a pool
PNG_START = b"\x89PNG\r\n\x1a\n"
JPEG_START = b"\xff\xd8"
FRAMES = (
    0xC0,
    0xC1,
    0xC2,
    0xC9,
    0xCA,
)  # markers of T.81 that begin a frame of a kind that is decoded
SCAN = 0xDA  # the picture itself begins


def packed_as(head: bytes) -> str:
    """What a file is by its first bytes, and what to do; "" if it is none of MAGICS."""
    return next((said for magic, said in MAGICS.items() if head.startswith(magic)), "")


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in px of a JPEG or PNG picture, None if its head says none.

    Source: PNG specification, 11.2.1 (IHDR).
    """
    if data[:8] == PNG_START:
        if len(data) < 24 or data[12:16] != b"IHDR":
            return None
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    return jpeg_size(data) if data[:2] == JPEG_START else None


def jpeg_size(jpeg: bytes) -> tuple[int, int] | None:
    """Width and height in px from the start-of-frame segment, None if there is none.

    Source: ITU-T T.81, annex B. Bytes between two segments are passed over, as decoders do.
    """
    at = 2
    while (at := jpeg.find(b"\xff", at)) >= 0 and at + 9 <= len(jpeg):
        marker = jpeg[at + 1]
        if marker in (0x00, 0xFF):
            at += 1
        elif marker in FRAMES:
            height = int.from_bytes(jpeg[at + 5 : at + 7], "big")
            return int.from_bytes(jpeg[at + 7 : at + 9], "big"), height
        elif marker == SCAN:
            return None
        else:
            at += 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
    return None
