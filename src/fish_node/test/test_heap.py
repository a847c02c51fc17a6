# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Freed pictures cost no page faults the next time."""

import resource

import numpy as np
import pytest

from fish_node.nodes.heap import keep_freed_memory


def test_large_blocks_are_used_again() -> None:
    if not keep_freed_memory():
        pytest.skip("the C library has no mallopt")
    size = 5 * 2**20
    np.ones(size, np.uint8)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones(size, np.uint8)
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    assert faults < 20 * size / resource.getpagesize() / 10
