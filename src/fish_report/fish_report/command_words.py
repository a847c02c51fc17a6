# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the user typed, for files that tell by which command they came about."""

from __future__ import annotations

from collections.abc import Sequence


def words_after(verb: str, argv: Sequence[str]) -> list[str]:
    """Words after the verb, of `robofish VERB ...` as of the verb's own executable."""
    return list(argv[2:] if argv[1:2] == [verb] else argv[1:])
