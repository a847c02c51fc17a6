# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Texts of foreign origin made harmless.

Texts from files and from other nodes may hold anything: escape sequences that a terminal would obey, or a megabyte.
"""

from __future__ import annotations

import unicodedata

LONGEST = 400  # characters of a text of foreign origin
HIDDEN = (
    "Cc",
    "Cf",
    "Cs",
    "Co",
    "Cn",
    "Zl",
    "Zp",
)  # Unicode categories that a terminal obeys or hides


def plain(text: object, longest: int = LONGEST) -> str:
    """One line of visible characters: others become their escapes, and a long text is cut in the middle."""
    whole = str(text)
    half = longest // 2
    if len(whole) > longest:
        left_out = f" ... {len(whole) - 2 * half} characters ... "
        whole = whole[:half] + left_out + whole[-half:]
    shown = "".join(
        char.encode("unicode_escape").decode() if unicodedata.category(char) in HIDDEN else char
        for char in whole
    )
    return shown
