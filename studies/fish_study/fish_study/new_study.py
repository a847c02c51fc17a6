# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A study of what the command line asks for: begun, or gone on with where its folder holds one."""

from __future__ import annotations

import secrets
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fish_report.robofish import words_after
from fish_study.scenario import Scenario
from fish_study.scenario_groups import draw_scenarios
from fish_study.study import Study
from fish_study.tool_version import tool_digest


@dataclass(frozen=True)
class Asked:
    """What makes a study. given: the names of those that the command line gives; the others are the defaults."""

    scenarios: int
    groups: Sequence[str]
    trials: int
    duration: float  # s
    seed: int | None  # None: drawn now
    given: frozenset[str] = frozenset()
    recordings: str = ""  # folder of a user's recordings, for the group "injected"

    def values(self) -> dict[str, Any]:
        """Of all but `given`, as study.json has them."""
        return {
            "scenarios": self.scenarios,
            "groups": list(self.groups),
            "trials": self.trials,
            "duration": self.duration,
            "seed": self.seed,
            **({"recordings": self.recordings} if self.recordings else {}),
        }

    def draw(self, seed: int) -> list[Scenario]:
        """The scenarios of a seed. Raises ValueError for groups or numbers that no study can have."""
        drawn = draw_scenarios(self.scenarios, list(self.groups), seed)
        return [self._sized(s) for s in drawn]

    def _sized(self, scenario: Scenario) -> Scenario:
        """With the trials asked for; a pair of days has its own unless they are given, and twice as many of OLD."""
        if scenario.plant == "recordings":
            return replace(scenario, recordings=self.recordings)
        if not scenario.pair:
            return replace(scenario, count=self.trials, duration=self.duration)
        asked: dict[str, Any] = {}
        if "trials" in self.given:
            asked |= {"count": self.trials, "old": 2 * self.trials}
        if "duration" in self.given:
            asked["duration"] = self.duration
        return replace(scenario, **asked)


def begin_or_go_on(folder: Path, asked: Asked, more: Mapping[str, Any] | None = None) -> Study:
    """The study in the folder, or a new one; more: further entries of study.json, which must agree too.

    Raises StudyError where the folder's study is another one than asked for, or of another version of the tool.
    """
    more = dict(more or {})
    if (folder / "study.json").exists():
        study = Study(folder)
        given = {name: value for name, value in asked.values().items() if name in asked.given}
        study.check_asked({**given, **more})
        if study.pending:
            study.check_tool(tool_digest())
        return study
    seed = secrets.randbits(62) if asked.seed is None else asked.seed
    about = {
        **asked.values(),
        "seed": seed,
        "drawn": asked.seed is None,
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["robofish", "prove", *words_after("prove", sys.argv)]),
        "tool": tool_digest(),
        **more,
    }
    return Study.create(folder, asked.draw(seed), about)
