"""A study on disk: sealed labels, one result per world, everything there to go on after a kill.

study.json   what was asked for, and of which version of the tool
seals.json   world -> SHA-256 of salt and label; written before any run
sealed.json  salts and labels (mode 0600); nothing passes it to the tool
worlds/world_0001/{recordings, tool, result.json}
             result.json has the version that answered, and so has judged.json beside it
labels.json  the opened labels; written when every world has a result
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fish_report.json_file import write_json
from fish_study.commitment import Sealed, broken_seals, seal_label
from fish_study.scenario import World


class StudyError(ValueError):
    """A study folder that cannot be used; the message says why."""


@dataclass(frozen=True)
class Study:
    """A folder and what is in it."""

    folder: Path

    @classmethod
    def create(cls, folder: Path, worlds: Sequence[World], about: Mapping[str, Any]) -> Study:
        """Seal the labels of new worlds; seals are on disk when this returns. Raises StudyError if a study is there."""
        if (folder / "study.json").exists():
            raise StudyError(f"{folder}: holds a study already")
        folder.mkdir(parents=True, exist_ok=True)
        names = [f"world_{i:04d}" for i in range(len(worlds))]
        sealed = {
            name: seal_label(world.label()) for name, world in zip(names, worlds, strict=True)
        }
        write_json(folder / "sealed.json", {k: asdict(s) for k, s in sealed.items()}, private=True)
        write_json(folder / "seals.json", {name: s.seal for name, s in sealed.items()})
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
                f"{self.folder}: got version {own or 'unknown'} of the tool, expected {digest or 'unknown'}; worlds of"
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
        """Raise StudyError if a world's file (name -> content) was made by another version of the tool than the study's.

        Files from before they told it are taken for the study's.
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
    def worlds(self) -> dict[str, World]:
        """Every world, from the sealed labels. For the runner and for the judge, never for the tool."""
        return {name: World.of(s.label) for name, s in self._sealed().items()}

    def place(self, name: str) -> Path:
        """Folder of a world."""
        return self.folder / "worlds" / name

    @property
    def open_worlds(self) -> list[str]:
        """Names without a result."""
        return [name for name in self.worlds if not (self.place(name) / "result.json").exists()]

    @property
    def results(self) -> dict[str, dict[str, Any]]:
        """What the tool answered, for worlds that have a result. Raises StudyError if not one version answered all."""
        found = {name: self.place(name) / "result.json" for name in self.worlds}
        results = {name: read_json(path) for name, path in found.items() if path.exists()}
        self.check_files("result.json", results)
        return results

    def reveal(self) -> dict[str, World]:
        """Open the labels and check every seal. Raises StudyError if a world has no result or a seal is broken."""
        if self.open_worlds:
            raise StudyError(
                f"{self.folder}: {len(self.open_worlds)} worlds have no result yet; labels stay sealed"
            )
        opened, seals = self._sealed(), read_json(self.folder / "seals.json")
        broken = broken_seals(seals, opened)
        if broken:
            raise StudyError(
                f"{self.folder}: labels that are not what was sealed: {', '.join(broken)}"
            )
        write_json(self.folder / "labels.json", {k: asdict(s) for k, s in opened.items()})
        return {name: World.of(s.label) for name, s in opened.items()}

    def _sealed(self) -> dict[str, Sealed]:
        return {
            name: Sealed(**content)
            for name, content in read_json(self.folder / "sealed.json").items()
        }


def check_apart(studies: Sequence[Study]) -> None:
    """Raise StudyError if a world is in these studies twice, as it would count twice. Its seed tells it."""
    seen: dict[int, Path] = {}
    for study in studies:
        for name, world in study.worlds.items():
            if world.seed in seen:
                raise StudyError(
                    f"got the world of seed {world.seed} twice, as {seen[world.seed]} and {study.place(name)}; expected every"
                    " world once: leave one of these studies out"
                )
            seen[world.seed] = study.place(name)


def read_json(path: Path) -> Any:
    """Content of a JSON file. Raises StudyError if it is not one."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise StudyError(f"{path}: cannot be read ({error})") from error
