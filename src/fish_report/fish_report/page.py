# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One self-contained HTML page of tables and plotly figures; opens without network, server or other files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import plotly.graph_objects as go
from jinja2 import Environment
from plotly.offline import get_plotlyjs

from fish_report.files import write_whole

FONT = "system-ui, sans-serif"


@dataclass(frozen=True)
class Text:
    """A paragraph under a heading (either may be empty)."""

    title: str
    text: str
    kind: str = "text"


@dataclass(frozen=True)
class Table:
    """Rows of cells, all text; numbers are formatted by the caller."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    kind: str = "table"


@dataclass(frozen=True)
class Figure:
    """A plotly figure and what it shows."""

    title: str
    figure: go.Figure
    note: str = ""
    kind: str = "figure"

    @property
    def html(self) -> str:
        """The figure as a <div>; the library itself stands once in the page."""
        html = self.figure.to_html(
            full_html=False,
            include_plotlyjs=False,
            config={"displaylogo": False, "responsive": True},
        )
        return str(html)


Block = Text | Table | Figure


def write_page(path: Path, title: str, lead: str, blocks: Sequence[Block]) -> None:
    """Write title, one leading sentence and the blocks in order; an earlier page stays until this one is whole."""
    template = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
        files(__package__).joinpath("page.html.j2").read_text(encoding="utf-8")
    )
    page = template.render(
        title=title, lead=lead, blocks=blocks, plotlyjs=get_plotlyjs(), font=FONT
    )
    # names of files may hold bytes that are no UTF-8
    write_whole(path, page, errors="backslashreplace")


def styled(figure: go.Figure, height: int = 320, titled: bool = False) -> go.Figure:
    """The look all figures share; returns the same figure. titled: its panels have titles, which the legend must not cover."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        font={"family": FONT, "size": 13},
        margin={"l": 60, "r": 20, "t": 70 if titled else 20, "b": 45},
        legend={
            "orientation": "h",
            "y": 1.0 + (30 if titled else 5) / height,
            "yanchor": "bottom",
            "x": 0,
        },
    )
    return figure
