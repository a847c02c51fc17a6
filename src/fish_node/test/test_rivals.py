# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A second node that publishes the same is noticed, one that takes over is not."""

from fish_node.rivals import Rivals


def test_only_who_stays_is_a_rival():
    counts = [1, 2, 1, 2, 2, 2, 3, 1, 2, 2, 2]  # once a second
    times, warned = iter(range(len(counts))), []
    rivals = Rivals("/fish/x", lambda _: counts.pop(0), warned.append, lambda: float(next(times)))
    said = [rivals.warning() for _ in range(len(counts))]
    assert [bool(words) for words in said] == [False] * 5 + [True, True] + [False] * 3 + [True]
    assert said[5].startswith("another publisher of /fish/x")
    assert warned == [said[5]] * 2  # once for each
