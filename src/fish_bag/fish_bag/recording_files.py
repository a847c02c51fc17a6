# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which files a recording consists of, and what kind each is: by its first bytes, not by its name."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fish_bag.bag_metadata import FILE_NAME, LFS_START, StatedMetadata, read_metadata
from fish_bag.problem import RecordingError
from fish_bag.storage import name_by_magic

PARTS = (".mcap", ".db3")  # of files in a rosbag2 folder
PACKED = (".zstd", ".zst", ".lz4")  # a whole file compressed, as rosbag2's mode `file` leaves it
SUFFIXES = (*PARTS, ".bag", ".bag.active")
LOGS = (".db3-wal", ".db3-journal")  # that sqlite3 keeps with its database
MAGICS = {b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "sqlite3", b"#ROSBAG V": "ros1"}
LFS_MAGIC = LFS_START.encode()
STRANGERS = {
    b"\x1f\x8b": ("a gzip file", "gunzip it"),
    b"BZh": ("a bzip2 file", "bunzip2 it"),
    b"\xfd7zXZ": ("an xz file", "unxz it"),
    b"PK\3\4": ("a zip archive", "unzip it"),
    b"7z\xbc\xaf": ("a 7z archive", "unpack it"),
    b"/annex/objects": ("a git-annex pointer", "'git annex get' brings the recording"),
    b"\x89MCAP0\n": (
        "an MCAP file whose line ends were changed",
        "copy it again, as a binary file",
    ),
    b"\x89MCAP0\r\r\n": (
        "an MCAP file whose line ends were changed",
        "copy it again, as a binary file",
    ),
    b"<!DOCTYPE": ("a web page", "download the file itself"),
    b"<html": ("a web page", "download the file itself"),
}  # first bytes of files that are given the name of a recording
KINDS = {".mcap": "mcap", ".db3": "sqlite3", ".bag": "ros1", ".active": "ros1"}  # by the name
PART_NAME = re.compile(r"(?P<stem>.*?)_?(?P<number>\d+)")


@dataclass
class RecordingFiles:
    """The storage files of one recording, in order."""

    path: Path
    files: list[Path]
    stated: StatedMetadata | None = None
    notes: list[str] = field(default_factory=list)


def is_storage_file(path: Path) -> bool:
    """Whether the name is one of a storage file; macOS leaves others with ._ before the name."""
    return bare_name(path.name).lower().endswith(SUFFIXES) and not path.name.startswith("._")


def files_under(path: Path) -> list[Path]:
    """The files of all recordings that a path gives: itself, or those in the folder and in the folders in it."""
    if not path.is_dir():
        return [path]
    return [
        file
        for pattern in ("*", "*/*")
        for file in path.glob(pattern)
        if is_storage_file(file) or file.name == FILE_NAME or file.name.endswith(LOGS)
    ]


def bare_name(name: str) -> str:
    """A file's name without the ending of a compression."""
    for end in PACKED:
        if name.lower().endswith(end):
            name = name[: -len(end)]
    return name


def is_recording(path: Path) -> bool:
    """Whether `path` looks like one recording (not: is readable)."""
    if path.is_dir():
        return (path / FILE_NAME).exists() or bool(parts(path))
    return is_storage_file(path)


def parts(folder: Path) -> list[Path]:
    """Storage files of the one recording in a folder without metadata.yaml; [] where they are recordings of their own.

    rosbag2 splits a long recording into <folder>_0, <folder>_1 and so on. A file of ROS 1 is a recording of its own.
    """
    inside = list(folder.iterdir())
    files = sorted((p for p in inside if p.is_file() and _is_part(p)), key=part_order)
    split = re.compile(rf"{re.escape(folder.name)}_\d+\.(?:mcap|db3)")
    one = [f.suffix != ".bag" for f in files] == [True] or all(
        split.fullmatch(bare_name(file.name)) for file in files
    )
    below = any(is_recording(p) for p in inside if p.is_dir())
    return files if files and one and not below else []


def _is_part(path: Path) -> bool:
    return is_storage_file(path) and bare_name(path.name).lower().endswith(PARTS)


def part_order(path: Path) -> tuple[str, int, str]:
    """Sort key: part 10 comes after part 9."""
    found = PART_NAME.fullmatch(bare_name(path.name).split(".")[0])
    return (found["stem"], int(found["number"]), path.name) if found else (path.stem, -1, path.name)


def find_files(path: Path) -> RecordingFiles:
    """The storage files of a recording.

    Args:
        path: a storage file, or the folder of one recording.

    Raises:
        RecordingError: there is none, or there are those of several recordings.
    """
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    if path.is_file():
        return RecordingFiles(path, [path])
    if not path.is_dir():
        raise RecordingError(f"{path}: neither a file nor a folder")
    stated = read_metadata(path)
    if stated is not None:
        return _stated_files(path, stated)
    files = [p for p in path.iterdir() if is_storage_file(p)]
    found = parts(path) or (files if len(files) == 1 else [])
    if not found:
        logs = [p for p in path.iterdir() if p.name.endswith(LOGS)]
        advice = "give one of the recordings in it" if files else "there is no recording in it"
        if logs and not files:
            advice = f"{_names(logs)} belongs to a database that is not there; bring it back"
        raise RecordingError(
            f"{path}: no {FILE_NAME} and {len(files)} storage files, which are not the parts {path.name}_0, "
            f"{path.name}_1 and so on of one recording; {advice}"
        )
    found, twice = _once(found)
    notes = [f"no {FILE_NAME}; {_names(found)} read in this order"] if len(found) > 1 else []
    if twice:
        notes.append(f"{_names(twice)} not read, as another file is the same part")
    if gaps := _missing_parts(found, path.name):
        notes.append(f"part {', '.join(map(str, gaps))} is not there")
    return RecordingFiles(path, found, None, notes)


def _once(files: list[Path]) -> tuple[list[Path], list[Path]]:
    """The files in their order, each part once, and those that are a part again: unpacked or in another format."""
    once: dict[tuple[str, int], Path] = {}
    for file in files:
        stem, number, _ = part_order(file)
        once.setdefault((stem if number >= 0 else bare_name(file.name), number), file)
    return list(once.values()), [file for file in files if file not in once.values()]


def _missing_parts(files: list[Path], folder: str) -> list[int]:
    """Numbers of parts that are absent between the first part, 0, and the last; a name of another stem has no part number."""
    order = [part_order(file) for file in files]
    if any(stem != folder or number < 0 for stem, number, _ in order):
        return []
    numbers = {number for _, number, _ in order}
    return sorted(set(range(max(numbers) + 1)) - numbers)


def _stated_files(path: Path, stated: StatedMetadata) -> RecordingFiles:
    """The files that metadata.yaml names, and others where it names none or too few."""
    there = {p.name: p for p in sorted(path.iterdir(), key=part_order) if is_storage_file(p)}
    listed = [there[name] for name in dict.fromkeys(stated.files) if name in there]
    missing = [name for name in stated.files if name not in there]
    others = [file for name, file in there.items() if name not in stated.files]
    notes = list(stated.notes)
    if missing:
        notes.append(f"{FILE_NAME} names {', '.join(missing)}, which is not there")
    if missing or not listed:
        taken = others
    else:  # a recorder that was killed has not named its last part yet
        stems = {part_order(file)[0] for file in listed if part_order(file)[1] >= 0}
        taken = [f for f in others if part_order(f)[1] >= 0 and part_order(f)[0] in stems]
    taken = [file for file in _once(listed + taken)[0] if file in taken]
    if taken and stated.files:
        notes.append(f"{_names(taken)} read though {FILE_NAME} does not name it")
    left = [file for file in others if file not in taken]
    if left:
        notes.append(f"{_names(left)} not read, as {FILE_NAME} does not name it")
    if len(set(stated.files)) < len(stated.files):
        notes.append(f"{FILE_NAME} names a file twice; it is read once")
    files = listed + taken
    if not files:
        held = ", ".join(sorted(p.name for p in path.iterdir())) or "nothing"
        raise RecordingError(f"{path}: no storage file ({', '.join(PARTS)}); it holds {held}")
    return RecordingFiles(path, sorted(files, key=part_order) if taken else files, stated, notes)


def _names(files: list[Path]) -> str:
    return ", ".join(file.name for file in files)


def file_kind(path: Path, data: Any) -> str:
    """The format "mcap", "sqlite3" or "ros1", or the compression of a whole file.

    Args:
        path: for its name, where the first bytes are damaged.
        data: the file's bytes.

    Raises:
        RecordingError: it is not a recording; the text says what it is.
    """
    head = bytes(data[:32])
    if head.startswith(LFS_MAGIC):
        raise RecordingError(
            f"{path}: a Git LFS pointer, not the recording; 'git lfs pull' brings the recording"
        )
    for magic, kind in MAGICS.items():
        if head.startswith(magic):
            return kind
    packed = name_by_magic(head)
    if packed:
        return packed
    for magic, (name, remedy) in STRANGERS.items():
        if head.lstrip().lower().startswith(magic.lower()):
            raise RecordingError(f"{path}: {name}, not a recording; {remedy}")
    kind = KINDS.get(Path(bare_name(path.name)).suffix.lower(), "")
    if not kind:
        raise RecordingError(
            f"{path}: not a recording; expected a rosbag2 directory or a file {', '.join(SUFFIXES)}"
        )
    return kind
