# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's walls: the fish stops there, truth and sensors agree, and nothing changes for a fish that never comes to them."""

import math

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.pool import LENGTH, WIDTH
from fish_sim.robot import Robot
from fish_sim.simulation import APART, EDGE, Readings, Simulation, Walls
from fish_sim.simulation_config import SimulationConfig

EXACT = {
    "gyro_noise": 0.0,
    "gyro_bias": 0.0,
    "accelerometer_noise": 0.0,
    "accelerometer_bias": 0.0,
    "disturbance": 0.0,
}
# where a fish that swims straight comes to a wall within two seconds: a wall's normal is x or y
TOWARDS = {
    "east": ({"start_x": LENGTH / 2 - 0.1}, 0),
    "north": ({"start_y": WIDTH / 2 - 0.1, "start_heading": 0.5 * math.pi}, 1),
    "west": ({"start_x": 0.1 - LENGTH / 2, "start_heading": math.pi}, 0),
}


def swim(simulation: Simulation, seconds: float) -> list[Readings]:
    readings = []
    for _ in range(round(seconds / DT)):
        simulation.command(110.0 * math.sin(4.0 * math.pi * (simulation.time + DT)), 0.0)
        readings.append(simulation.advance())
    return readings


def columns(readings: list[Readings]) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 2) [m] and velocities (N, 2) [m/s], pool frame."""
    pose, velocity = (
        np.array([getattr(r.truth, key) for r in readings]) for key in ("pose", "velocity")
    )
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    u, v = velocity[:, :2].T
    return pose[:, :2], np.column_stack([cos * u - sin * v, sin * u + cos * v])


@pytest.mark.parametrize(("start", "normal"), TOWARDS.values(), ids=TOWARDS)
def test_a_fish_that_swims_against_a_wall_stops_there(start, normal):
    simulation = Simulation(Robot(), SimulationConfig(**EXACT, **start))
    readings = swim(simulation, 6.0)
    place, velocity = columns(readings)
    assert np.abs(place[:, normal]).max() == EDGE[normal]
    at_wall = np.abs(place[:, normal]) == EDGE[normal]
    assert at_wall.sum() > 100
    assert (velocity[at_wall, normal] * place[at_wall, normal]).max() < 1e-9  # never outward
    assert np.abs(velocity).max() < 1.0
    assert simulation.walls.contacts == 1
    assert np.abs(simulation.walls.place[normal]) == EDGE[normal]


@pytest.mark.parametrize(("start", "normal"), TOWARDS.values(), ids=TOWARDS)
def test_the_accelerometer_feels_how_the_velocity_changes_at_the_wall(start, normal):
    """Summed over the contact it is the change of velocity along the normal: neither a push nor an impact is left out."""
    readings = swim(Simulation(Robot(), SimulationConfig(**EXACT, **start)), 6.0)
    place, velocity = columns(readings)
    heading = np.array([r.truth.pose[2] for r in readings])
    felt = np.array([r.imu.specific_force[:2] for r in readings])
    cos, sin = np.cos(heading), np.sin(heading)
    pool = np.column_stack(
        [cos * felt[:, 0] - sin * felt[:, 1], sin * felt[:, 0] + cos * felt[:, 1]]
    )
    at_wall = np.flatnonzero(np.abs(place[:, normal]) == EDGE[normal])
    change = (velocity[at_wall] - velocity[at_wall - 1])[:, normal] / DT
    np.testing.assert_allclose(pool[at_wall, normal], change, atol=1e-9)
    assert np.abs(pool).max() < 60.0  # m/s^2, a stop from 0.5 m/s within a period is 50


def test_a_fish_that_never_comes_to_a_wall_swims_the_same_to_the_last_bit():
    with_walls, without = (
        swim(Simulation(Robot(), SimulationConfig(walls=walls)), 5.0) for walls in (True, False)
    )
    for a, b in zip(with_walls, without, strict=True):
        assert a.truth == b.truth
        assert a.rotor == b.rotor
        assert a.camera == b.camera
        assert np.array_equal(a.imu.specific_force, b.imu.specific_force)


def test_without_walls_the_water_has_no_end():
    start, _ = TOWARDS["east"]
    simulation = Simulation(Robot(), SimulationConfig(walls=False, **EXACT, **start))
    place, _ = columns(swim(simulation, 6.0))
    assert place[:, 0].max() > EDGE[0] + 0.1
    assert simulation.walls.contacts == 0


def touch(walls: Walls, time: float, x: float) -> tuple[float, float]:
    position, velocity = np.array([x, 0.0]), np.array([0.2, 0.1])
    walls.hold(time, position, velocity)
    return float(position[0]), float(velocity[0])


def test_touches_stroke_after_stroke_are_one_contact():
    walls = Walls()
    for time in (1.0, 1.5, 2.0, 2.0 + 0.9 * APART):
        assert touch(walls, time, EDGE[0] + 1e-3) == (EDGE[0], 0.0)
    assert walls.contacts == 1
    assert touch(walls, 5.0, 2.0) == (2.0, 0.2)
    assert not walls.touches(5.0)
    touch(walls, 5.0 + APART, EDGE[0] + 1e-3)
    assert walls.contacts == 2
    assert walls.place == (EDGE[0], 0.0)
    walls.leave()
    touch(walls, 5.0 + APART, EDGE[0] + 1e-3)
    assert walls.contacts == 3


def test_a_fish_beyond_the_wall_that_comes_back_keeps_its_velocity():
    position, velocity = np.array([0.0, EDGE[1] + 0.01]), np.array([0.1, -0.2])
    assert Walls().hold(0.0, position, velocity).tolist() == [False, True]
    assert position.tolist() == [0.0, EDGE[1]]
    assert velocity.tolist() == [0.1, -0.2]
