# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The points of a CSV file, found by the names of their columns."""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.reference_path import PathError

DELIMITERS = (";", "\t", ",")  # the first that a file has; a comma is then the decimal sign
METRES = {"": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001}  # units that a heading may name
_NUMBER = re.compile(
    r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE
)
_NAME = re.compile(r"([xy])(?:\s*[\[(]\s*(\w*)\s*[\])]|[\s_](\w+))?", re.IGNORECASE)
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)  # byte order marks; UTF-32's begins with UTF-16's


@dataclass(frozen=True)
class _Columns:
    """Where x and y stand in a row, and metres in their unit."""

    x: int
    y: int
    metres: float = 1.0
    named: int = 0  # columns of the heading, 0 without one


def read_points(file: Path) -> NDArray[np.float64]:
    """Points (M, 2) [m] in the pool's frame: x along the pool, y to the left of it.

    Columns named x and y are used wherever they stand; their unit may follow, as in `x [mm]`. A file without a heading
    has exactly the two columns x, y. Fields are separated by commas, semicolons or tabs; with semicolons, tabs or
    quotes the decimal sign may be a comma. Empty lines and lines that begin with # are no rows, but a comment before
    the first point that names the columns, as NumPy writes it, is a heading where there is no other.

    Raises:
        PathError: a line that is no point, or columns that do not say which is x and which is y.

    """
    text = _decode(file)
    delimiter = _delimiter(text, file)
    columns: _Columns | None = None
    remarks: dict[_Columns | None, str] = {}  # what comments say of the columns
    points: list[tuple[float, float]] = []
    signs: set[str] = set()
    for number, row, comment in _rows(text, delimiter, file):
        if comment:
            found = _heading(row, file, number, comment) or _heading(
                _two_names(delimiter.join(row)), file, number, comment
            )
            if not points and (found or _speaks_of_columns(row)):
                remarks.setdefault(found, f"line {number}, the comment {_shown(row)},")
            continue
        heading = columns is None and _heading(row, file, number, comment)
        if heading:
            columns = heading
        else:
            columns = columns or _by_remark(remarks, file) or _without_heading(row, file, number)
            points.append(_point(row, columns, file, number))
            signs |= {sign for k in (columns.x, columns.y) for sign in ".," if sign in row[k]}
    if len(signs) > 1:
        raise PathError(
            f"{file}: decimal points and decimal commas in one file; expected one of them"
        )
    return np.array(points, dtype=float).reshape(-1, 2)


def _decode(file: Path) -> str:
    content = file.read_bytes()
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise PathError(f"{str(file)!r} is not UTF-8 text with lines x,y ({error})") from error
    if "\0" in text:
        raise PathError(f"{str(file)!r} is not UTF-8 text with lines x,y (a byte 0 stands in it)")
    return re.sub(r"\r\n?", "\n", text)


def _delimiter(text: str, file: Path) -> str:
    """What separates the fields: the sign that every row has, outside of quotes."""
    lines = [re.sub(r'"[^"]*"', "quoted", line) for line in text.split("\n")]
    if lines and (
        said := re.fullmatch(r"sep=(.)", lines[0].strip(), re.IGNORECASE)
    ):  # a spreadsheet's own hint
        return said[1]
    rows = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    found = [sign for sign in DELIMITERS if rows and all(sign in row for row in rows)]
    some = [sign for sign in DELIMITERS[:2] if any(sign in row for row in rows)]
    if not rows or (not found and not some):
        return ","
    if not found or (some and some[0] not in found) or len(some) > 1:
        raise PathError(
            f"{file}: {(some or found)[0]!r} separates the fields of some lines and not of others"
        )
    return found[0]


def _rows(text: str, delimiter: str, file: Path) -> Iterator[tuple[int, list[str], bool]]:
    """Number, fields and whether it is a comment, of every line that is not empty."""
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip(" ")
        comment = content.lstrip().startswith("#")
        if not content.strip() or re.fullmatch(r"sep=.", content, re.IGNORECASE):
            continue
        try:
            reader = csv.reader(
                io.StringIO(content.lstrip("# \t") if comment else content), delimiter=delimiter
            )
            row = [field.strip() for field in next(reader, [])]
        except csv.Error as error:
            raise PathError(
                f"{str(file)!r} is not UTF-8 text with lines x,y (line {number}: {error})"
            ) from error
        while len(row) > 2 and not row[-1]:  # a delimiter at the line's end
            row.pop()
        yield number, row, comment


def _heading(row: list[str], file: Path, number: int, comment: bool) -> _Columns | None:
    """The columns that a row of names gives; None for a row with a number in it, and for a comment of other words."""
    if any(_NUMBER.fullmatch(field) for field in row) or any(field[:1].isdigit() for field in row):
        return None
    names = [_NAME.fullmatch(field) for field in row]
    at = {axis: [k for k, n in enumerate(names) if n and n[1].lower() == axis] for axis in "xy"}
    if len(at["x"]) != 1 or len(at["y"]) != 1:
        if comment:
            return None
        raise PathError(
            f"{file}: line {number} is {_shown(row)}, expected two numbers x,y or a heading with one column x and one y"
        )
    x, y = at["x"][0], at["y"][0]
    units = [(n[2] or n[3] or "") for n in (names[x], names[y]) if n]
    if units[0] != units[1] or units[0].lower() not in METRES:
        raise PathError(
            f"{file}: line {number} has x in {units[0]!r} and y in {units[1]!r}, expected both in m, cm or mm"
        )
    return _Columns(x, y, METRES[units[0].lower()], named=len(row))


def _two_names(comment: str) -> list[str]:
    """The words of a comment such as `columns: y [mm] x [mm]` if they are two, however they are separated."""
    words = re.split(r"\s*[,;\t]\s*|\s+(?![\[(])", comment.rsplit(":", 1)[-1].strip())
    return words if len(words) == 2 else []


def _speaks_of_columns(row: list[str]) -> bool:
    """Whether the fields of a comment begin with the names x and y, so that it may mean columns."""
    words = [re.split(r"\W", field, maxsplit=1)[0].lower() for field in row]
    return len(row) > 1 and {"x", "y"} <= set(words)


def _by_remark(remarks: dict[_Columns | None, str], file: Path) -> _Columns | None:
    """The columns that the comments give, if they give any and agree."""
    if len(remarks) > 1 or None in remarks:
        said = remarks.get(None) or list(remarks.values())[1]
        raise PathError(
            f"{file}: {said} seems to name the columns and is not understood; write the heading x,y or x [mm],y [mm]"
            " in a line of its own, without #"
        )
    return next(iter(remarks), None)


def _without_heading(row: list[str], file: Path, number: int) -> _Columns:
    if len(row) != 2:
        raise PathError(
            f"{file}: line {number} is {_shown(row)}, expected two numbers x,y; name the columns x and y in a heading if"
            " there are others"
        )
    return _Columns(0, 1)


def _point(row: list[str], columns: _Columns, file: Path, number: int) -> tuple[float, float]:
    fields = [row[k] for k in (columns.x, columns.y) if k < len(row)]
    if (
        len(fields) < 2
        or len(row) > (columns.named or 2)
        or not all(map(_NUMBER.fullmatch, fields))
    ):
        raise PathError(
            f"{file}: line {number} is {_shown(row)}, expected two numbers x,y"
            + (f" in {columns.named} columns" if columns.named > 2 else "")
        )
    x, y = (float(field.replace(",", ".")) * columns.metres for field in fields)
    if not (math.isfinite(x) and math.isfinite(y)):
        raise PathError(f"{file}: line {number} has a coordinate that is not finite")
    return x, y


def _shown(row: list[str]) -> str:
    text = ",".join(row)
    return repr(text if len(text) <= 60 else text[:60] + "...")
