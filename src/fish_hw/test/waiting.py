# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Waiting for something to become true, with an end."""

import time
from collections.abc import Callable


def wait_until(condition: Callable[[], bool], timeout_s: float = 5.0) -> bool:
    """Whether condition came true within timeout_s."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.002)
    return condition()
