# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Texts of other nodes, made harmless before they are logged or published again."""

from __future__ import annotations

LONGEST = 400  # characters


def visible(text: str) -> str:
    """The first LONGEST characters of a text; those that a terminal obeys or hides become their escapes."""
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode()
        for char in text[:LONGEST]
    )
