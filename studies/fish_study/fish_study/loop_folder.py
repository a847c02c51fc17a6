# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a closed loop: for which scenario it was made, so that nothing in it is taken for another scenario's.

loop.json    the scenario and the arguments on which what is kept depends
recordings   of the second plant, all trials or none
"""

from __future__ import annotations

import shutil
from typing import Any

from fish_report.json_file import plain, write_json
from fish_study.build import make_recordings
from fish_study.close_loop import SEARCH_SEEDS, Plan
from fish_study.study import StudyError, read_json


def prepare(plan: Plan) -> None:
    """Make a new folder with the recordings, or go on in the same plan's. Raises StudyError where it is none of this plan."""
    _claim(plan)
    if plan.recordings.exists():
        return
    part = plan.recordings.with_suffix(".part")  # half a set must not pass for a whole one
    shutil.rmtree(part, ignore_errors=True)
    make_recordings(plan.scenario, part)
    part.rename(plan.recordings)


def _claim(plan: Plan) -> None:
    path, asked = plan.out / "loop.json", _asked(plan)
    if not path.exists():
        if plan.out.exists() and any(plan.out.iterdir()):
            raise StudyError(
                f"{plan.out}: has no loop.json, so nothing says for which scenario its files were made; expected a new or empty"
                " folder: choose another --out, or move these files away"
            )
        plan.out.mkdir(parents=True, exist_ok=True)
        write_json(path, asked)
    made = read_json(path)
    differ = [key for key in {**made, **asked} if made.get(key) != asked.get(key)]
    if differ:
        said = "; ".join(f"{key} {made.get(key)}, got {asked.get(key)}" for key in differ)
        raise StudyError(
            f"{plan.out}: holds a loop of {said}: ask for the same, or choose another --out"
        )


def _asked(plan: Plan) -> dict[str, Any]:
    """As JSON gives it back. What is made anew at every run, the number of trainings and of tries in the search are no part."""
    return dict(
        plain(
            {
                **plan.scenario.label(),
                "robot": None if plan.nominal is None else str(plan.nominal.resolve()),
                "paths": plan.paths,
                "speeds": plan.speeds,
                "search seeds": SEARCH_SEEDS,
                "training": plan.training,
            }
        )
    )
