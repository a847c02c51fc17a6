# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of the paper: what stands beside its numbers, and how its seeds are trained."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from fish_sim.robot import Robot
from fish_study import paper_numbers as paper
from fish_study.paper_page import better_cells, training_blocks
from fish_study.verbs.paper import trained
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.study import Row
from fish_train.training.closed_loop_equations import Law
from fish_train.training.run_log import CurveRow


def sizes(cross_track: float, speed: float) -> ErrorSizes:
    return ErrorSizes(
        cross_track, cross_track, cross_track, cross_track, 0.0, speed, speed, speed, 0.0, 0.0
    )


def rows_of(scale: float) -> list[Row]:
    """The paper's own numbers times `scale`."""
    return [
        Row("a", "c", Cell(letter, v, 0), RunMetrics(*[sizes(scale * y, scale * u)] * 2, 1.0, ""))
        for letter in paper.LETTERS
        for v, y, u in zip(
            paper.SPEEDS, paper.CROSS_TRACK[letter], paper.SPEED[letter], strict=True
        )
    ]


def test_cells_better_than_the_papers() -> None:
    assert better_cells(rows_of(0.9)) == 16
    assert better_cells(rows_of(1.1)) == 0
    assert better_cells([*rows_of(0.9)[:15], *rows_of(1.1)[15:]]) == 15
    *good, last = rows_of(0.9)
    failed = replace(last, metrics=replace(last.metrics, failure="did not reach the end in time"))
    assert better_cells([*good, failed]) == 15


def test_seeds_that_diverged_are_counted() -> None:
    curve = [
        CurveRow(1.0 * k, 3 * k, 10 * k, 0, 1.0, 0.1, 0.1, 0.1, (0.3, 0.0, 0.0, 0.6, 0.0, 0.0))
        for k in (1, 2)
    ]
    (note,) = training_blocks([curve, []], 2)
    assert "0 of 2 seeds passed all 2 levels" in note.note
    assert "1 of 2 seeds diverged" in note.note
    (text,) = training_blocks([[]], 2)
    assert "1 of 1 seeds diverged" in text.text


def test_the_papers_training_on_a_robot_has_that_robots_law(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs = []
    own = Law(limits=replace(Law().limits, curvature_gain=0.3))
    monkeypatch.setattr("fish_train.evaluation.open_loop.law_of_robot", lambda _: own)
    monkeypatch.setattr(
        "fish_train.training.parallel_runs.run_all", lambda todo, *_: jobs.extend(todo)
    )
    monkeypatch.setattr("fish_train.training.run_log.read_curve", lambda _: [])
    for file in (Path("models/heavy.yaml"), None):
        trained(tmp_path, 1, Robot(), file, 1, Console(file=StringIO()))
    assert [job.law for job in jobs] == [own, Law()]
    assert [job.command for job in jobs] == [
        "robofish train --robot heavy.yaml --seed 1",
        "robofish train --seed 1",
    ]
