# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables as Markdown, and pages of which a part between two marks is generated."""

from __future__ import annotations

from pathlib import Path

from fish_report.page import Table

BEGIN, END = "<!-- generated: begin -->", "<!-- generated: end -->"


def markdown_table(table: Table, level: int = 3) -> str:
    """A heading, the table and its note."""
    lines = [f"{'#' * level} {table.title}", ""]
    for row in (table.header, ["---"] * len(table.header), *table.rows):
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    return "\n".join([*lines, "", *([table.note, ""] if table.note else [])])


def generated_part(page: Path) -> str:
    """What stands between the marks. Raises ValueError where a mark is missing."""
    return _parts(page)[1]


def write_generated_part(page: Path, text: str) -> None:
    """Put this between the marks. Raises ValueError where a mark is missing."""
    before, _, after = _parts(page)
    page.write_text(f"{before}{BEGIN}\n{text}{END}{after}", encoding="utf-8")


def _parts(page: Path) -> tuple[str, str, str]:
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"{page}: expected one line {BEGIN} and after it one line {END}")
    before, rest = text.split(BEGIN)
    own, after = rest.split(END)
    return before, own.removeprefix("\n"), after
