# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A study on disk: commitments to labels, one result per scenario, everything there to go on after a kill; and its archive.

study.json        what was asked for, and of which version of the tool
commitments.json  scenario -> SHA-256 of salt and label; written before any run
openings.json     salts and labels (mode 0600); nothing passes it to the tool
scenarios/scenario_0001/{recordings, tool, result.json}
                  result.json has the version that answered, and so has oracle.json beside it
labels.json       the opened labels; written when every scenario has a result

A commitment is the hash of a random salt and the label's JSON, published before the run and checked after it. An archive is
finished studies as one file: a tar archive, compressed by xz, with the folder of each study in it.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import secrets
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fish_report.files import write_json
from fish_study.scenario import Scenario

OF_STUDY = ("study.json", "commitments.json", "openings.json")
OF_SCENARIO = ("result.json", "oracle.json")


@dataclass(frozen=True)
class Opening:
    """What opens a commitment: the label and the salt that keeps its hash from being guessed."""

    salt: str
    label: Mapping[str, Any]

    @property
    def commitment(self) -> str:
        """What is published before the run."""
        text = json.dumps(self.label, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(f"{self.salt}:{text}".encode()).hexdigest()


def commit(label: Mapping[str, Any]) -> Opening:
    """A label with a fresh salt."""
    return Opening(secrets.token_hex(16), label)


def broken_commitments(
    commitments: Mapping[str, str], openings: Mapping[str, Opening]
) -> list[str]:
    """Names whose label is not the one that was committed to, is missing, or has no commitment."""
    names = {*commitments, *openings}
    return sorted(
        n for n in names if n not in openings or commitments.get(n) != openings[n].commitment
    )


class StudyError(ValueError):
    """A study folder that cannot be used; the message says why."""


@dataclass(frozen=True)
class Study:
    """A folder and what is in it."""

    folder: Path

    @classmethod
    def create(cls, folder: Path, scenarios: Sequence[Scenario], about: Mapping[str, Any]) -> Study:
        """Commit to the labels of new scenarios; the commitments are on disk when this returns.

        Raises StudyError if a study is there.
        """
        if (folder / "study.json").exists():
            raise StudyError(f"{folder}: holds a study already")
        folder.mkdir(parents=True, exist_ok=True)
        names = [f"scenario_{i:04d}" for i in range(len(scenarios))]
        openings = {
            name: commit(scenario.label()) for name, scenario in zip(names, scenarios, strict=True)
        }
        content = {name: asdict(opening) for name, opening in openings.items()}
        write_json(folder / "openings.json", content, private=True)
        write_json(
            folder / "commitments.json", {name: o.commitment for name, o in openings.items()}
        )
        write_json(folder / "study.json", about)
        return cls(folder)

    @property
    def about(self) -> dict[str, Any]:
        """What was asked for."""
        content: dict[str, Any] = read_json(self.folder / "study.json")
        return content

    def check_tool(self, digest: str) -> None:
        """Raise StudyError if this study examines another version of the tool than the one with this digest."""
        own = self.about.get("tool", "")
        if own != digest:
            raise StudyError(
                f"{self.folder}: got version {own or 'unknown'} of the tool, expected {digest or 'unknown'}; scenarios of"
                " two versions make no table: begin another study, or go back to the version that this one began with"
            )

    def check_asked(self, given: Mapping[str, Any]) -> None:
        """Raise StudyError if what is given on the command line is not what this study was begun with."""
        about = self.about
        differ = [
            f"{name} {value}, expected {about[name]}"
            for name, value in given.items()
            if about.get(name, value) != value
        ]
        if differ:
            raise StudyError(
                f"{self.folder}: holds a study that was begun with other arguments: got {'; '.join(differ)}: leave them out to go"
                " on with it, or choose another --out"
            )

    def check_files(self, kind: str, files: Mapping[str, Mapping[str, Any]]) -> None:
        """Raise StudyError if a scenario's file (name -> content) was made by another version of the tool than the study's.

        A file without a version counts as the study's.
        """
        own = self.about.get("tool", "")
        odd = [f"{name} of {f['tool']}" for name, f in files.items() if f.get("tool", own) != own]
        if odd:
            more = f" and {len(odd) - 3} more" if len(odd) > 3 else ""
            raise StudyError(
                f"{self.folder}: got {kind} in {', '.join(odd[:3])}{more}, expected version {own or 'unknown'} of the tool, as"
                " the study has: delete these files and make them again with that version"
            )

    @property
    def scenarios(self) -> dict[str, Scenario]:
        """Every scenario, from the labels. For the runner and the oracle, never for the tool."""
        return {name: Scenario.of(o.label) for name, o in self._openings().items()}

    def folder_of(self, name: str) -> Path:
        """Folder of a scenario."""
        return self.folder / "scenarios" / name

    @property
    def pending(self) -> list[str]:
        """Names without a result."""
        return [n for n in self.scenarios if not (self.folder_of(n) / "result.json").exists()]

    @property
    def results(self) -> dict[str, dict[str, Any]]:
        """What the tool answered, for scenarios that have a result. Raises StudyError if not one version answered all."""
        found = {name: self.folder_of(name) / "result.json" for name in self.scenarios}
        results = {name: read_json(path) for name, path in found.items() if path.exists()}
        self.check_files("result.json", results)
        return results

    def open_labels(self) -> dict[str, Scenario]:
        """Open the labels and check every commitment. Raises StudyError if a result is missing or a commitment is broken."""
        if self.pending:
            raise StudyError(
                f"{self.folder}: {len(self.pending)} scenarios have no result yet; labels stay sealed"
            )
        openings, commitments = self._openings(), read_json(self.folder / "commitments.json")
        broken = broken_commitments(commitments, openings)
        if broken:
            raise StudyError(
                f"{self.folder}: labels that are not those committed to: {', '.join(broken)}"
            )
        write_json(self.folder / "labels.json", {k: asdict(o) for k, o in openings.items()})
        return {name: Scenario.of(o.label) for name, o in openings.items()}

    def _openings(self) -> dict[str, Opening]:
        return {
            name: Opening(**content)
            for name, content in read_json(self.folder / "openings.json").items()
        }


def check_apart(studies: Sequence[Study]) -> None:
    """Raise StudyError if a scenario is in these studies twice, as it would count twice. Its seed identifies it."""
    seen: dict[int, Path] = {}
    for study in studies:
        for name, scenario in study.scenarios.items():
            if scenario.seed in seen:
                raise StudyError(
                    f"got the scenario of seed {scenario.seed} twice, as {seen[scenario.seed]} and {study.folder_of(name)};"
                    " expected every scenario once: leave one of these studies out"
                )
            seen[scenario.seed] = study.folder_of(name)


def read_json(path: Path) -> Any:
    """Content of a JSON file. Raises StudyError if it is not one."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise StudyError(f"{path}: cannot be read ({error})") from error


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
