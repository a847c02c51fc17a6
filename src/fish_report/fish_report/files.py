# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files and folders that a verb is given and writes: named paths, folders of results, JSON, YAML that a person has written."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from fish_report.errors import UserError


def named_path(path: Path) -> Path:
    """The path; of `.` and `..`, which have no name of their own, the folder's whole path."""
    return Path(os.path.abspath(path)) if path.name in ("", "..") else path


def writable_folder(
    folder: Path,
    option: str = "--out",
    names: Iterable[str] = (),
    inputs: Iterable[Path | None] = (),
) -> Path:
    """The folder, made now where it is not there.

    Args:
        names: of the files that will be written in it.
        inputs: what is read, None for what is not given.

    Raises:
        UserError: it is a file, or takes none, or one of the names is an input.
    """
    keep_inputs([folder / name for name in names], inputs, option)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        said = error.strerror or error
        raise UserError(
            f"{option} {folder}: {said}; expected a folder that can be written, choose another"
        ) from error
    return folder


def writable_file(file: Path, option: str = "--out", inputs: Iterable[Path | None] = ()) -> Path:
    """The file, its folder made now where it is not there; inputs: what is read, None for what is not given.

    Raises:
        UserError: it is a folder, or its folder takes no file, or it is an input.
    """
    if file.is_dir():
        raise UserError(f"{option} {file}: is a folder; expected a file, choose another name")
    keep_inputs([file], inputs, option)
    writable_folder(file.parent, option)
    return file


def keep_inputs(
    written: Iterable[Path], inputs: Iterable[Path | None], option: str = "--out"
) -> None:
    """Refuse to write over what is read.

    Raises:
        UserError: a file that will be written is an input, also where it goes by two names.
    """
    there = [path for path in inputs if path is not None and os.path.exists(path)]
    for file in filter(os.path.exists, written):
        if replaced := next((path for path in there if path.samefile(file)), None):
            raise UserError(
                f"{option}: {file} is the input {replaced}, which the result would replace; "
                f"expected another place, choose another {option}"
            )


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
    write_whole(path, json.dumps(plain(content), indent=1, allow_nan=False) + "\n", private)


def write_whole(path: Path, text: str, private: bool = False, errors: str = "strict") -> None:
    """Write a text in one step: what was there stays until all is written. A device or a pipe is written to itself.

    Args:
        private: for the owner's eyes only, from the first byte on.
        errors: what is done with characters that UTF-8 lacks, as in `str.encode`.
    """
    content = text.encode("utf-8", errors)
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    path = path.resolve() if path.is_symlink() else path
    part = path.with_name(f"{path.name}.part")
    try:
        part.unlink(missing_ok=True)  # one of an earlier run would keep its mode
        mode = 0o600 if private else 0o666  # less what the umask takes away
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(content)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


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


class GivenTwiceError(ValueError):
    """A table has two entries of one name."""


def unique_names(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A table of JSON (`object_pairs_hook`), of which json would take the last of two entries of one name.

    Raises:
        GivenTwiceError: there are two.
    """
    names = [name for name, _ in pairs]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise GivenTwiceError(f"{twice} is given twice in one table; keep one of the two")
    return dict(pairs)


class UniqueLoader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML without two entries of one name, of which PyYAML would take the last."""


def _unique(loader: UniqueLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        line = node.start_mark.line + 1
        raise GivenTwiceError(
            f"{twice[0]} is given twice in the table of line {line}; keep one of the two"
        )
    return dict(loader.construct_mapping(node, deep=True))


UniqueLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _unique)


def read_yaml(path: Path) -> Any:
    """What the file holds; None of an empty one.

    Raises:
        ValueError: it cannot be read, is no YAML, or has a table with two entries of one name.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=UniqueLoader)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from error
    except RecursionError:
        raise ValueError("cannot be read as YAML: its tables are nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # also no UTF-8, or a date such as 2020-13-45
        raise ValueError(f"cannot be read as YAML: {error}") from error
