# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where and when force is missing or an effect acts, from forces made by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fish_sysid.diagnosis.effect_wrench import intervals, regimes, size
from fish_sysid.diagnosis.latent_force import (
    MissingForce,
    covariate_shares,
    dof_shares,
    place_shares,
    time_shares,
)
from fish_sysid.estimation.ekf_types import Noise

UNIT = np.array([0.1, 0.1, 0.001])  # N, N, N m: what counts as one


def force(surge: np.ndarray, **covariates: np.ndarray) -> MissingForce:
    """Force ahead only (T, M), zero at once beyond a trial's end where it is NaN."""
    wrench = np.stack([surge, 0.0 * surge, 0.0 * surge], axis=-1)
    names = tuple(f"trial_{m:02d}" for m in range(surge.shape[1]))
    return MissingForce(names, wrench, np.zeros_like(wrench), covariates)


@pytest.fixture
def pushed() -> MissingForce:
    """0.2 N from 2 to 8 s of the second of two trials, right of the pool's middle and at large rudder angles."""
    t = 0.01 * np.arange(1000)
    when = (t >= 2.0) & (t < 8.0)
    surge = np.column_stack([np.zeros(1000), np.where(when, 0.2, 0.0)])
    random = np.random.default_rng(0)
    calm, moved = random.uniform(-0.5, 0.3, (1000, 2)), random.uniform(0.3, 0.5, 1000)
    rudder = calm.copy()
    rudder[when, 1] = moved[when]
    x = np.where(surge > 0.0, 0.3, -0.3) + random.uniform(-0.05, 0.05, (1000, 2))
    speed, still = random.standard_normal((1000, 2)), np.ones((1000, 2))
    return force(
        surge,
        rudder=rudder,
        x=x,
        y=0.0 * x,
        surge_speed=speed,
        rotor_speed=still,
        time=np.tile(t[:, None], 2),
    )


def test_the_windows_that_hold_most_of_a_force_have_their_share(
    pushed: MissingForce,
) -> None:
    rows = time_shares(pushed, UNIT)
    found = sorted((row["trial"], row["from"], row["to"], row["share"]) for row in rows[:3])
    third = pytest.approx(1.0 / 3.0)
    assert found == [
        ("trial_01", 2.0, 4.0, third),
        ("trial_01", 4.0, 6.0, third),
        ("trial_01", 6.0, 8.0, third),
    ]
    assert rows[3]["share"] == 0.0


def test_the_cell_of_the_pool_in_which_a_force_acts_is_found(pushed: MissingForce) -> None:
    cell = place_shares(pushed, UNIT)[0]
    assert cell["share"] == pytest.approx(1.0)
    (left, right), (low, high) = cell["x"], cell["y"]
    assert left <= 0.25
    assert 0.35 <= right
    assert low <= 0.0 <= high
    assert right - left < 1.0


def test_the_covariate_is_found_in_whose_range_a_force_acts(pushed: MissingForce) -> None:
    rows = {row["name"]: row for row in covariate_shares(pushed, UNIT)}
    assert rows["rudder"]["range"] == pytest.approx([0.3, 0.5], abs=0.06)  # over two bins
    assert rows["rudder"]["share"] == pytest.approx(1.0)
    assert rows["rudder"]["contrast"] > 3.0
    assert rows["surge_speed"]["contrast"] < 1.5
    assert "rotor_speed" not in rows
    assert "time" not in rows


def test_a_rudder_that_rests_is_not_what_a_force_depends_on() -> None:
    """A bin that holds most of the time holds most of a force that acts all the time, and is no denser for that."""
    random = np.random.default_rng(0)
    rudder = np.where(random.random((4000, 1)) < 0.6, 0.0, random.uniform(-0.4, 0.4, (4000, 1)))
    rows = covariate_shares(force(random.standard_normal((4000, 1)), rudder=rudder), UNIT)
    assert rows[0]["contrast"] < 1.2
    rows = covariate_shares(force(np.where(rudder > 0.2, 0.2, 0.0), rudder=rudder), UNIT)
    assert rows[0]["range"] == pytest.approx([0.2, 0.4], abs=0.15)
    assert rows[0]["contrast"] > 3.0


def test_the_last_window_of_a_shorter_trial_ends_with_it() -> None:
    surge = np.full((1000, 2), 0.1)
    surge[550:, 1] = np.nan
    surge[:400] = 0.0
    rows = time_shares(force(surge), UNIT)
    assert [
        (r["from"], r["to"]) for r in rows if r["trial"] == "trial_01" and r["share"] > 0.0
    ] == [(4.0, 5.5)]


def test_a_force_is_in_units_of_each_degree_of_freedom() -> None:
    """A hundredth of a newton metre weighs ten times a tenth of a newton."""
    wrench = np.zeros((400, 1, 3))
    wrench[:200, 0, 1], wrench[200:, 0, 2] = 0.1, 0.01
    first, second = time_shares(MissingForce(("a",), wrench, wrench, {}), UNIT)
    assert first["from"] == 2.0
    assert first["share"] == pytest.approx(100.0 / 101.0)
    assert second["share"] == pytest.approx(1.0 / 101.0)


def test_a_force_that_swings_with_the_tail_acts_all_the_while() -> None:
    """Its root mean square over a stroke; the interval ends where the force does, to half a stroke."""
    t = 0.01 * np.arange(1000)
    swing = np.where((t >= 3.0) & (t < 7.0), 0.3 * np.sin(4.0 * np.pi * t), 0.0)
    beating = force(np.column_stack([swing, np.where(t < 5.0, 0.0, np.nan)]))
    np.testing.assert_allclose(size(beating, UNIT)[330:670, 0], 3.0 / np.sqrt(2.0), rtol=0.02)
    assert np.isnan(size(beating, UNIT)[500:, 1]).all()
    (row,) = intervals(beating, UNIT)
    assert row["trial"] == "trial_00"
    assert row["share"] > 0.95
    assert (row["from"], row["to"]) == pytest.approx((3.0, 7.0), abs=0.25)


def test_two_intervals_share_the_impulse_the_larger_first() -> None:
    t = 0.01 * np.arange(1000)
    rows = intervals(force(np.where(t < 2.0, 0.1, np.where(t >= 7.0, 0.1, 0.0))[:, None]), UNIT)
    assert [row["from"] for row in rows] == [pytest.approx(7.0, abs=0.25), 0.0]
    assert rows[0]["to"] == 10.0
    assert rows[0]["share"] == pytest.approx(0.6, abs=0.03)


def test_the_most_telling_covariate_comes_first_with_its_range(pushed: MissingForce) -> None:
    rows = regimes(pushed, UNIT)
    assert [row["f1"] for row in rows] == sorted((row["f1"] for row in rows), reverse=True)
    by_name = {row["name"]: row for row in rows}
    assert by_name["rudder"]["range"] == pytest.approx([0.3, 0.5], abs=0.05)
    assert by_name["rudder"]["f1"] > 0.9
    assert by_name["x"]["range"] == pytest.approx([0.25, 0.35], abs=0.06)
    assert by_name["x"]["share"] > 0.9
    assert by_name["surge_speed"]["f1"] < 0.6
    assert {"time", "rotor_speed"}.isdisjoint(by_name)


def fit(*wrench: float, tau: float = 0.2) -> SimpleNamespace:
    return SimpleNamespace(noise=Noise(wrench=wrench, wrench_time=tau))


def test_shares_of_the_degrees_of_freedom_are_of_the_variance_that_only_the_nominal_model_needs() -> (
    None
):
    shares = dof_shares(fit(0.008, 0.004, 6e-4), fit(0.004, 0.008, 2e-4))
    assert shares == {"surge": pytest.approx(3 / 11), "sway": 0.0, "yaw": pytest.approx(8 / 11)}
    assert dof_shares(fit(0.004, 0.008, 2e-4), fit(0.004, 0.008, 2e-4)) == {
        "surge": 0.0,
        "sway": 0.0,
        "yaw": 0.0,
    }
