# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swims that are kept, one file for each gains: a closed loop that was stopped swims none of them twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from fish_report.json_file import number, write_json
from fish_study.gain_search import Say
from fish_study.study import read_json
from fish_train.evaluation.candidates import Candidate, PolicyGains
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.study import Condition, Row, run_study


def swim_each(
    gains: Mapping[str, Candidate],
    condition: Condition,
    cells: Sequence[Cell],
    jobs: int,
    folder: Path,
    say: Say,
) -> list[Row]:
    """Rows of all cells for each gains, in order; `folder` has NAME.json of those that are swum."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {
        name: _kept(folder / f"{name}.json", candidate, cells) for name, candidate in gains.items()
    }

    def keep(_: int, batch: list[Row]) -> None:
        name = batch[0].candidate
        rows[name] += batch
        if len(rows[name]) == len(cells):
            _keep(folder / f"{name}.json", gains[name], cells, rows[name])

    left = [replace(candidate, name=name) for name, candidate in gains.items() if not rows[name]]
    if left:
        say(f"swimming: {len(cells)} runs with each of {len(left)} gains")
        run_study(
            left,
            [condition],
            cells,
            jobs,
            lambda done, all_: say(f"swum: {done} of {all_} batches"),
            keep,
        )
    return [
        replace(row, candidate=candidate.name)
        for name, candidate in gains.items()
        for row in sorted(rows[name], key=lambda row: cells.index(row.cell))
    ]


def _keep(file: Path, candidate: Candidate, cells: Sequence[Cell], rows: Sequence[Row]) -> None:
    write_json(file, {"of": _what(candidate, cells), "rows": [asdict(row) for row in rows]})


def _kept(file: Path, candidate: Candidate, cells: Sequence[Cell]) -> list[Row]:
    """Empty where nothing was swum, or with other gains, another law or other cells."""
    content = read_json(file) if file.exists() else {}
    return (
        [_row(row) for row in content["rows"]]
        if content.get("of") == _what(candidate, cells)
        else []
    )


def _row(content: Mapping[str, Any]) -> Row:
    metrics = content["metrics"]
    settled, whole = (
        ErrorSizes(**{key: number(value) for key, value in metrics[part].items()})
        for part in ("settled", "whole")
    )
    measured = RunMetrics(settled, whole, number(metrics["approach"]), metrics["failure"])
    return Row(content["candidate"], content["condition"], Cell(**content["cell"]), measured)


def _what(candidate: Candidate, cells: Sequence[Cell]) -> str:
    """SHA-256 of weights, law and cells."""
    assert isinstance(candidate.gains, PolicyGains)
    policy = candidate.gains.policy
    digest = hashlib.sha256(json.dumps(policy.contract.to_json(), sort_keys=True).encode())
    for name, tensor in sorted(policy.tensors.items()):
        digest.update(name.encode() + tensor.tobytes())
    digest.update(f"{candidate.law} {list(cells)}".encode())
    return digest.hexdigest()
