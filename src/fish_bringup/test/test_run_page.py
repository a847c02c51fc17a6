# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pages: self-contained, and what came from outside is escaped."""

import re

import numpy as np
import plotly.graph_objects as go
import pytest

from fish_bag.trial import (
    Commands,
    Gains,
    Odometry,
    Trial,
)
from fish_bringup.run_page import write_run_page
from fish_bringup.score import score_motion
from fish_bringup.score_table import error_table
from fish_control.paths import make_path
from fish_report.page import (
    Figure,
    Table,
    Text,
    styled,
    write_page,
)


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "report.html"
    figure = Figure("Curve", styled(go.Figure(go.Scatter(x=[0, 1], y=[2, 3]))))
    blocks = [
        Text("Words", "a <b> & c"),
        Table("Numbers", ["name", "m"], [["<x>", "1.5"]], "a note"),
        figure,
    ]
    write_page(path, "Title", "Lead.", blocks)
    return path.read_text()


def test_a_page_loads_nothing(page):
    outside = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)\s*=\s*[\"']?([^\s\"'>]+)", page)
    assert outside == []


def test_text_is_escaped(page):
    assert "a &lt;b&gt; &amp; c" in page
    assert "<td>&lt;x&gt;</td>" in page


def test_blocks_stand_in_order_and_the_library_once(page):
    positions = [page.index(f"<h2>{title}</h2>") for title in ("Words", "Numbers", "Curve")]
    assert positions == sorted(positions)
    assert page.count("Plotly.newPlot(") == 1


def test_the_page_of_a_run_shows_path_errors_gains_and_commands(tmp_path):
    path = make_path("letter", letter="S")
    s = np.linspace(0.0, path.length, 500)
    t, zero = s / 0.2, np.zeros(500)
    stream = {
        "topic": "x",
        "frame_id": "pool",
        "t": t,
        "t_arrival": t,
        "flags": zero.astype(np.uint8),
    }
    x, y = path.point(s).T
    truth = Odometry(**stream, x=x, y=y, psi=path.heading_at(s), u=zero + 0.2, v=zero, r=zero)
    trial = Trial(
        name="run",
        path=tmp_path,
        origin_ns=0,
        duration=t[-1],
        namespace="/fish",
        axis="robot",
        truth=truth,
        commands=Commands(**stream, rotor_phase=zero, rotor_speed=zero, rudder=zero),
        gains=Gains(**stream, names=(), values=np.ones((500, 6))),
    )
    score = score_motion(truth, path, 0.2, 0.0, "truth")
    write_run_page(tmp_path / "report.html", "Run", trial, score, [error_table(score)])
    html = (tmp_path / "report.html").read_text()
    for title in (
        "Path in the pool",
        "Tracking errors",
        "Errors",
        "Surge speed",
        "Gains",
        "Commands",
    ):
        assert f"<h2>{title}</h2>" in html
