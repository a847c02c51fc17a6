# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Devices made of software, for tests and for trying the nodes with no hardware."""

import math


def int16(value: float) -> int:
    """A number as the nearest that a register of 16 bits holds; 0 for what is no number."""
    return 0 if math.isnan(value) else int(min(max(value, -0x8000), 0x7FFF))
