# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was read of an MCAP file against what its statistics say."""

from __future__ import annotations

from collections import Counter

from fish_bag.mcap_records import Summary
from fish_bag.storage import Contents

PRIVATE = 0x80  # from here on opcodes of applications


def compare_statistics(contents: Contents, summary: Summary | None, strange: Counter[int]) -> None:
    """Say every difference in `contents`.

    Args:
        summary: of the file, None without one.
        strange: opcode -> records of a kind that is not known.
    """
    counts, total = (summary.counts, summary.total) if summary else (None, None)
    if counts is not None:
        contents.compare_counts(counts, "its statistics")
    agree = counts == {c: len(m) for c, m in contents.messages.items() if len(m)}
    if total not in (None, contents.count) and (counts is None or agree):
        contents.notes.append(
            f"{contents.count} messages are in the file, its statistics say {total}"
        )
    if strange:
        kinds = ", ".join(f"{opcode:#04x} ({n})" for opcode, n in sorted(strange.items()))
        said = contents.notes if agree or min(strange) >= PRIVATE else contents.lost
        said.append(f"records of kinds that MCAP does not define: {kinds}; they are left out")
