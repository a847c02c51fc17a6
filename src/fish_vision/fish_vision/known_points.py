# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Points of the pool whose places are known, for the camera's mount."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fish_vision.calibration import POOL, Array, CalibrationError

FORMATS = (("x", "y", "u", "v"), ("id", "x", "y"), ("x", "y"))


@dataclass(frozen=True)
class KnownPoints:
    """Names, places (N, 2) in the pool frame, m, and pixels (N, 2) where they are known; tags: the names are numbers."""

    names: tuple[str, ...]
    places: Array
    pixels: Array | None = None
    tags: bool = False

    def at(self, pixels: Mapping[str, tuple[float, float]]) -> "KnownPoints":
        """Those points that are seen, name -> u, v, with their pixels."""
        chosen = [i for i, name in enumerate(self.names) if name in pixels]
        names = tuple(self.names[i] for i in chosen)
        seen = np.array([pixels[name] for name in names]).reshape(-1, 2)
        return KnownPoints(names, self.places[chosen], seen, self.tags)


def pool_corners(sides: tuple[float, float] = POOL) -> KnownPoints:
    """The corners of the walls' inner faces at the water; sides: along x and y, m."""
    x, y = sides[0] / 2, sides[1] / 2
    places = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
    return KnownPoints(tuple(_name(place) for place in places), places)


def read_points(path: Path) -> KnownPoints:
    """Points from a CSV file with header x,y,u,v or id,x,y or x,y.

    Raises:
        CalibrationError: no such file, another header, a line with more or fewer fields, or a value that is no finite number.
    """
    lines: list[int] = []
    rows: list[list[float]] = []
    try:
        with path.open(
            newline="", encoding="utf-8-sig"
        ) as file:  # spreadsheets write a byte order mark
            table = csv.reader(file)
            header = [name.strip() for name in next(table, [])]
            form = next((f for f in FORMATS if set(f) <= set(header)), None)
            if form is None or any(header.count(name) > 1 for name in form):
                raise ValueError(f"header {','.join(header)}")
            places = [header.index(name) for name in form]
            for row in filter(any, table):
                lines.append(table.line_num)
                if len(row) != len(header):
                    raise ValueError(
                        f"line {lines[-1]} has {len(row)} fields for {len(header)} names"
                    )
                rows.append([float(row[k]) for k in places])
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise CalibrationError(
            f"{path}: expected CSV with header x,y,u,v or id,x,y or x,y, commas between fields and numbers with points"
            f" ({error})"
        ) from error
    values = np.array(rows).reshape(-1, len(form))
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values).all(axis=1)))
        raise CalibrationError(f"{path}: line {lines[k]} has {rows[k]}: expected finite numbers")
    if form[0] == "id":
        if (values[:, 0] % 1).any():
            raise CalibrationError(f"{path}: an id is no whole number; expected those of the tags")
        return KnownPoints(tuple(str(int(v)) for v in values[:, 0]), values[:, 1:], tags=True)
    pixels = values[:, 2:] if len(form) == 4 else None
    return KnownPoints(tuple(_name(place) for place in values[:, :2]), values[:, :2], pixels)


def _name(place: Array) -> str:
    return f"{place[0]:+.3f} {place[1]:+.3f}"
