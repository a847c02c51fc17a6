# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The training curve of a run: a CSV file and TensorBoard events, cut back to the checkpoint on resume and on divergence."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from types import TracebackType

from torch.utils.tensorboard import SummaryWriter

from fish_control.policy_spec import OUTPUTS
from fish_report.errors import UserError
from fish_train.training.trainer import Progress

CURVE = "curve.csv"
GAIN_COLUMNS = tuple(o.name for o in OUTPUTS)
COLUMNS = ("seconds", *(f.name for f in fields(Progress) if f.name != "gains"), *GAIN_COLUMNS)


class RunLog:
    """Appends rows; a context manager."""

    def __init__(self, folder: Path, update: int) -> None:
        """Keep the rows up to `update`, drop what was written after the checkpoint."""
        self._folder = folder
        self.seconds = self._open(update)  # spent before this start

    def _open(self, update: int) -> float:
        """Cut both at `update` and go on from there; the seconds of the last row that is kept."""
        path = self._folder / CURVE
        kept = [row for row in _rows(path) if int(row["update"]) <= update] if path.exists() else []
        fresh = path.with_suffix(".new")
        with fresh.open("w", newline="", encoding="utf-8") as stream:
            table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(kept)
        os.replace(fresh, path)
        self._file = path.open("a", newline="", encoding="utf-8")
        self._table = csv.DictWriter(self._file, COLUMNS, lineterminator="\n")
        self._events = SummaryWriter(str(self._folder / "tensorboard"), purge_step=update + 1)
        return float(kept[-1]["seconds"]) if kept else 0.0

    def roll_back(self, update: int) -> None:
        """Drop the rows after `update`; the seconds before this start stay what they were."""
        self._close()
        self._open(update)

    def add(self, seconds: float, progress: Progress) -> None:
        """One episode."""
        values = {f.name: getattr(progress, f.name) for f in fields(progress) if f.name != "gains"}
        gains = dict(zip(GAIN_COLUMNS, progress.gains, strict=True))
        self._table.writerow({"seconds": f"{seconds:.3f}", **values, **gains})
        for name in (
            "cost",
            "cross_track",
            "heading",
            "speed",
            "criterion",
            "gradient_norm",
            "level",
        ):
            self._events.add_scalar(f"train/{name}", values[name], progress.update)
        for name, value in gains.items():
            self._events.add_scalar(f"gains/{name}", value, progress.update)

    def flush(self) -> None:
        """Bring everything to disk: before a checkpoint is written."""
        self._file.flush()
        self._events.flush()

    def __enter__(self) -> RunLog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._close()

    def _close(self) -> None:
        self._file.close()
        self._events.close()


@dataclass(frozen=True)
class CurveRow:
    """One episode of a finished or running training."""

    seconds: float
    update: int
    environment_steps: int
    level: int
    cost: float
    cross_track: float
    heading: float
    speed: float
    gains: tuple[float, ...]


def read_curve(folder: Path) -> list[CurveRow]:
    """The curve of a run's folder."""
    path = folder / CURVE
    if not path.exists():
        raise UserError(
            f"{path}: no training curve here; expected a folder written by robofish train"
        )
    return [
        CurveRow(
            seconds=float(row["seconds"]),
            update=int(row["update"]),
            environment_steps=int(row["environment_steps"]),
            level=int(row["level"]),
            cost=float(row["cost"]),
            cross_track=float(row["cross_track"]),
            heading=float(row["heading"]),
            speed=float(row["speed"]),
            gains=tuple(float(row[k]) for k in GAIN_COLUMNS),
        )
        for row in _rows(path)
    ]


def _rows(path: Path) -> Iterator[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = csv.DictReader(stream)
        if tuple(rows.fieldnames or ()) != COLUMNS:
            raise UserError(f"{path}: columns are {rows.fieldnames}; expected {list(COLUMNS)}")
        # a kill can leave a last line cut short
        yield from (row for row in rows if None not in row.values())
