# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of a comparison: its curves are drawn and the change brings them nearer; no cell is "nan"."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from swims import fish, swim

from fish_sysid.diagnosis.change.change import Change, Member, Named
from fish_sysid.diagnosis.change.change_json import answer
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.reports.change_page import side_by_side, write_change_page

FLOW = {"x": 0.05, "y": 0.0}  # m/s


@pytest.fixture(scope="module")
def change() -> Change:
    """Water that moves in NEW alone, found by the gyro's answer as it were: without a p-value of the rest."""
    values = {k: Estimate(v, 0.001, "m/s") for k, v in FLOW.items()}
    member = Member("current", 1.0, 10.0, float("nan"), Refitted(values, "", np.zeros(3)))
    return Change(
        "changed", p_value=0.002, look="mean motion", named=(Named((member,), "", 10.0, 1.0),), remainder_p_value=0.4,
        robot=fish(), old=swim(fish(), duration=8.0), new=swim(fish(current=FLOW), duration=8.0, seed=1),
    )  # fmt: skip


def test_the_curves_of_new_follow_it_better_with_the_change(change: Change) -> None:
    figure = side_by_side(change).figure
    surge = [s for s in figure.data if s.yaxis in ("y4", "y5", "y6")]  # of NEW's trials
    measured = np.concatenate([np.array(s.y) for s in surge if s.name == "measured"])
    errors = {}
    for name in ("OLD's model", "with the change"):
        apart = np.concatenate([np.array(s.y) for s in surge if s.name == name]) - measured
        assert np.isfinite(apart).mean() > 0.8
        errors[name] = np.sqrt(np.nanmean(apart**2))
    assert errors["with the change"] < 0.01  # m/s
    assert errors["with the change"] < 0.5 * errors["OLD's model"] < 0.05


def test_a_number_that_is_not_known_is_no_nan_on_the_page(change: Change, tmp_path: Path) -> None:
    write_change_page(tmp_path / "report.html", "today", answer(change), change)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<td>1.00</td><td>–</td>" in page
    assert "<td>nan</td>" not in page
