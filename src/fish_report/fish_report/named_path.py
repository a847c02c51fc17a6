# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A path whose last part is a name, after which pages and titles are called."""

from __future__ import annotations

import os
from pathlib import Path


def named_path(path: Path) -> Path:
    """The path; of `.` and `..`, which have no name of their own, the folder's whole path."""
    return Path(os.path.abspath(path)) if path.name in ("", "..") else path
