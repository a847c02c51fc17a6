# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The second plant swims, turns and drifts as a fish in water does."""

from __future__ import annotations

import numpy as np
import pytest

from fish_study import scenario_groups
from fish_study.mujoco_effects import CONCEALED
from fish_study.mujoco_plant import MujocoPlant, model_text
from fish_study.true_names import true_names


def test_what_the_second_plant_conceals_is_drawn_in_turn_nothing_included() -> None:
    pytest.importorskip("mujoco")
    scenarios = [
        scenario_groups.mujoco(np.random.default_rng(seed), number)
        for number in range(9)
        for seed in range(8)
    ]
    assert {w.names for w in scenarios} == {(), *((name,) for name in CONCEALED)}
    assert [true_names(w) for w in scenarios if w.names == ("wind",)] == [("current",)] * 8
    assert {true_names(w) for w in scenarios if w.names == ("viscosity",)} == {()}
    wind = np.array([list(w.effects["wind"].values()) for w in scenarios if w.names == ("wind",)])
    factors = wind / list(CONCEALED["wind"].typical.values())
    assert np.allclose(factors[:, 0], factors[:, 1])
    assert set(np.sign(factors[:, 0])) == {1.0, -1.0}
    assert np.all((np.abs(factors) >= 0.85) & (np.abs(factors) <= 1.15))


@pytest.fixture(scope="module")
def basin():
    """The second plant, nothing concealed, still water."""
    pytest.importorskip("mujoco")
    return lambda count, **effects: MujocoPlant(
        model_text(5, {}, effects), count, 0.0, np.random.default_rng(0)
    )


def drive(plant, rudder: np.ndarray, seconds: float) -> np.ndarray:
    """(T, M, 6) motion at 10 to 15 % throttle."""
    plant.reset(np.zeros((len(rudder), 3)))
    rows = []
    for k in range(round(100 * seconds)):
        rotor = min(1.0, 0.01 * k) * 50.0 * np.sin(2.0 * np.pi * 2.0 * 0.01 * k)
        plant.step(np.column_stack([np.full(len(rudder), rotor), rudder]))
        rows.append(plant.motion)
    return np.array(rows)


@pytest.mark.slow
def test_the_second_plant_swims_and_turns_as_the_rudder_says(basin) -> None:
    motion = drive(basin(3), np.array([0.0, 0.5, -0.5]), 6.0)[-200:].mean(axis=0)
    assert 0.05 < motion[0, 3] < 0.3
    assert abs(motion[0, 5]) < 0.02
    assert motion[1, 5] > 0.05
    assert motion[2, 5] < -0.05


def test_the_second_plants_wind_carries_the_fish(basin) -> None:
    plant = basin(1, wind={"x": 0.05, "y": 0.0})
    plant.reset(np.zeros((1, 3)))
    for _ in range(300):
        felt = plant.step(np.zeros((1, 2)))
    assert plant.pose[0] == pytest.approx([0.15, 0.0, 0.0], abs=1e-6)
    assert abs(felt.left[0]) < 1e-6


@pytest.mark.slow
def test_seen_from_the_water_the_second_plant_swims_in_wind_as_in_still_water(basin) -> None:
    """Galilei: whichever way it faces, also at low throttle with the wind from behind."""
    wind, rudder = np.array([0.04, -0.03]), np.array([0.0, 0.1])
    still, blown = (
        drive(p, rudder, 6.0) for p in (basin(2), basin(2, wind={"x": wind[0], "y": wind[1]}))
    )
    carried = 0.01 * np.arange(1, len(blown) + 1)[:, None, None] * wind
    np.testing.assert_allclose(blown[..., :2] - carried, still[..., :2], atol=1e-3)
    np.testing.assert_allclose(blown[..., 2], still[..., 2], atol=1e-2)
    assert (
        blown[-100:, 0, 3].mean() > still[-100:, 0, 3].mean() + 0.03
    )  # from behind: faster over ground


@pytest.mark.slow
def test_a_second_plant_that_is_pushed_backwards_at_the_start_swims_ahead(basin) -> None:
    plant = basin(2)
    plant.reset(np.zeros((2, 3)))
    for data in plant._data:
        data.qvel[0] -= 0.03
    speed = []
    for k in range(600):
        rotor = min(1.0, 0.01 * k) * 50.0 * np.sin(2.0 * np.pi * 2.0 * 0.01 * k)
        plant.step(np.tile([rotor, 0.0], (2, 1)))
        speed.append(plant.motion[:, 3])
    assert np.all(np.mean(speed[-100:], axis=0) > 0.05)
