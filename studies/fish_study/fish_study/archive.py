# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Finished studies as one file: a tar archive, compressed by xz, with the folder of each study in it."""

from __future__ import annotations

import json
import lzma
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fish_study.study import Study, StudyError, read_json

OF_STUDY = ("study.json", "commitments.json", "openings.json")
OF_SCENARIO = ("result.json", "oracle.json")


@contextmanager
def opened_studies(paths: Sequence[Path]) -> Iterator[list[Study]]:
    """Studies of folders and archives, those of an archive in the order of their names, in a folder that goes afterwards.

    Raises StudyError for what is neither.
    """
    with TemporaryDirectory() as scratch:
        studies = []
        for k, path in enumerate(paths):
            studies += [Study(path)] if path.is_dir() else _unpacked(path, Path(scratch) / str(k))
        yield studies


def pack_studies(studies: Sequence[Study], file: Path) -> None:
    """Write finished studies as an archive: commitments, labels, results, the oracle's scores.

    The same studies give the same bytes.
    """
    with tarfile.open(file, "w:xz", preset=9) as archive:
        for number, study in enumerate(studies, 1):
            part = f"{number:02d}"
            for name in OF_STUDY:
                _add(archive, f"{part}/{name}", read_json(study.folder / name))
            for scenario in study.scenarios:
                for name in OF_SCENARIO:
                    path = study.folder_of(scenario) / name
                    if path.exists():
                        _add(archive, f"{part}/scenarios/{scenario}/{name}", read_json(path))


def _add(archive: tarfile.TarFile, name: str, content: Any) -> None:
    data = json.dumps(content, separators=(",", ":")).encode()
    info = tarfile.TarInfo(name)
    info.size = len(data)
    archive.addfile(info, BytesIO(data))


def _unpacked(file: Path, folder: Path) -> list[Study]:
    try:
        with tarfile.open(file, "r:xz") as archive:
            archive.extractall(folder, filter="data")
    except (OSError, EOFError, lzma.LZMAError, tarfile.TarError) as error:
        raise StudyError(
            f"{file}: cannot be read as studies ({error}); expected the folder of a study, or an archive such as"
            " studies/data/blind_study_26.tar.xz"
        ) from error
    studies = [Study(path.parent) for path in sorted(folder.glob("*/study.json"))]
    if not studies:
        raise StudyError(f"{file}: has no folder with a study.json: it is no archive of studies")
    return studies
