# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that hold another thing than their name says: a pointer of Git LFS, or a compressed file."""

from __future__ import annotations

MAGICS = {
    b"version https://git-lfs": "a Git LFS pointer; 'git lfs pull' brings the file",
    b"\x1f\x8b": "compressed by gzip; gunzip it",
    b"PK\3\4": "a zip archive; unzip it",
    b"(\xb5/\xfd": "compressed by zstd; unzstd it",
}  # first bytes -> what the file is, and what to do


def packed_as(head: bytes) -> str:
    """What a file is by its first bytes, and what to do; "" if it is none of MAGICS."""
    return next((said for magic, said in MAGICS.items() if head.startswith(magic)), "")
