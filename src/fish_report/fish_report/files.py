# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files and folders that a verb is given and writes: named paths, folders of results, JSON, YAML that a person has written."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from fish_report.errors import UserError


def named_path(path: Path) -> Path:
    """The path; of `.` and `..`, which have no name of their own, the folder's whole path."""
    return Path(os.path.abspath(path)) if path.name in ("", "..") else path


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
    """The file for what was finished when the work was interrupted; an earlier whole result stays."""
    return file.with_stem(f"{file.stem}_partial")


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


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML without two entries of one name, of which PyYAML would take the last."""


def _unique(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        line = node.start_mark.line + 1
        raise ValueError(
            f"{twice[0]} is given twice in the table of line {line}; keep one of the two"
        )
    return dict(loader.construct_mapping(node, deep=True))


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _unique)


def read_yaml(path: Path) -> Any:
    """What the file holds; None of an empty one.

    Raises:
        ValueError: it cannot be read, is no YAML, or has a table with two entries of one name.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from error
    except RecursionError:
        raise ValueError("cannot be read as YAML: its tables are nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # also no UTF-8, or a date such as 2020-13-45
        raise ValueError(f"cannot be read as YAML: {error}") from error
