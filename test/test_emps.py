# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The example that is no fish: names dry friction where there is some, nothing where there is none."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[1] / "examples" / "emps" / "positioning_drive.py"
MASS, VISCOUS, DRY = 95.0, 200.0, 20.0  # kg, N s/m, N


@pytest.fixture(scope="module")
def drive():
    spec = importlib.util.spec_from_file_location("positioning_drive", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["positioning_drive"] = module
    spec.loader.exec_module(module)
    return module


def swing(dry: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(t, force, position) of a stage under PD control, at 1 kHz for 10 s, integrated ten times finer."""
    random = np.random.default_rng(3)
    t = 1e-3 * np.arange(10_000)
    goal = 0.1 * np.sin(1.3 * t) + 0.03 * np.sin(3.1 * t + 1.0)
    position, force = np.empty_like(t), np.empty_like(t)
    q = v = push = 0.0
    for k in range(len(t)):
        position[k] = q
        force[k] = 4e4 * (goal[k] - q) - 3e3 * v
        push += -push * 1e-3 / 0.05 + 0.3 * random.standard_normal() * np.sqrt(2e-3 / 0.05)
        for _ in range(10):
            a = (force[k] + push - VISCOUS * v - dry * np.tanh(v / 1e-3)) / MASS
            v += 1e-4 * a
            q += 1e-4 * v
    return t, force, np.round(position + 5e-8 * random.standard_normal(len(t)), 8)


def test_dry_friction_is_named_and_the_rest_refitted(drive) -> None:
    answer = drive.diagnose(drive.record(*swing(DRY)))
    assert answer.final.terms[0] == "dry_friction" == max(answer.ranking, key=answer.ranking.get)
    assert answer.final.coefficients["dry_friction"] == pytest.approx(DRY, rel=0.1)
    assert answer.final.viscous == pytest.approx(VISCOUS, rel=0.1)
    assert answer.nominal.viscous > 1.3 * VISCOUS
    assert answer.final.mass == pytest.approx(MASS, rel=0.02)
    assert answer.held_out["with"] < 0.5 * answer.held_out["without"]


def test_nothing_is_named_where_nothing_is_missing(drive) -> None:
    answer = drive.diagnose(drive.record(*swing(0.0)))
    assert answer.final.terms == ()
    assert answer.final.viscous == pytest.approx(VISCOUS, rel=0.03)


def test_absent_data_are_one_line(drive, capsys) -> None:
    assert drive.main(["/nowhere/emps.csv.gz"]) == 1
    assert capsys.readouterr().err.startswith("/nowhere/emps.csv.gz: no such file")
