# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""JSON that every reader can read: what is not finite becomes null, numpy's numbers become plain ones."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_json(path: Path, content: Any, private: bool = False) -> None:
    """Write indented JSON in one step: a reader never sees half of it. private: for the owner's eyes only."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(plain(content), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if private:
        part.chmod(0o600)
    os.replace(part, path)


def number(value: float | None, absent: float = math.nan) -> float:
    """A number of such a file; `absent` for null."""
    return absent if value is None else float(value)


def plain(value: Any) -> Any:
    """The same with null for NaN and infinities, lists for sequences; raises TypeError for anything else."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return plain(value.tolist())
    number = float(value)
    return number if math.isfinite(number) else None
