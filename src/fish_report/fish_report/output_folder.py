# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The new folder into which a verb writes."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from fish_report.errors import UserError


def new_folder(out: Path | None, name: str) -> Path:
    """`out`, or out/NAME_DATE_TIME where it is None, made now.

    Raises:
        UserError: there is something in it.
    """
    folder = out or Path("out") / f"{name}_{datetime.now():%Y%m%d_%H%M%S}"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not empty; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    return folder
