# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names of frames. A second fish has a prefix before every frame's name but the pool's, which both share."""

from __future__ import annotations

import re

POOL, BODY, IMU = "pool", "base_link", "imu_link"
PREFIX = re.compile(r"([A-Za-z]\w*/)*")


def require_frame_prefix(prefix: str) -> None:
    """Raise ValueError unless a prefix is empty or ends with a slash, such as fish_2/."""
    if not PREFIX.fullmatch(prefix):
        raise ValueError(
            f"frame_prefix is {prefix!r}, expected nothing or names that end with a slash, such as 'fish_2/'"
        )


def require_frame(name: str, frame: str) -> None:
    """Raise ValueError unless the parameter `name` holds a frame: not empty, no slash in front, as tf2 asks."""
    if not frame or frame.startswith("/") or any(c.isspace() for c in frame):
        raise ValueError(
            f"{name} is {frame!r}, expected the name of a frame, without a slash in front"
        )
