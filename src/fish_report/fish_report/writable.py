# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where a verb writes, tried before it computes for minutes or hours what it then could not keep."""

from __future__ import annotations

import tempfile
from pathlib import Path

from fish_report.errors import UserError


def writable_folder(folder: Path) -> Path:
    """The folder, made now where it is not there.

    Raises:
        UserError: it is a file, or takes none.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        said = error.strerror or error
        raise UserError(
            f"--out {folder}: {said}; expected a folder that can be written, choose another"
        ) from error
    return folder


def writable_file(file: Path) -> Path:
    """The file, its folder made now where it is not there.

    Raises:
        UserError: it is a folder, or its folder takes no file.
    """
    if file.is_dir():
        raise UserError(f"--out {file}: is a folder; expected a file, choose another name")
    writable_folder(file.parent)
    return file


def partial_file(file: Path) -> Path:
    """Beside it, what was finished when the work was interrupted: a whole result of before stays."""
    return file.with_stem(f"{file.stem}_partial")
