# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool without ROS: commands, stale commands, noise from one seed, reset."""

import math

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig, SimulatorConfig

QUIET = {
    "gyro_noise": 0.0,
    "gyro_bias": 0.0,
    "accelerometer_noise": 0.0,
    "accelerometer_bias": 0.0,
    "encoder_angle_noise": 0.0,
    "encoder_speed_noise": 0.0,
    "disturbance": 0.0,
}


def swim(simulation, periods, rudder=0.0, amplitude=9.0):
    readings = []
    for _ in range(periods):
        speed = amplitude * 4 * math.pi * math.sin(4 * math.pi * (simulation.time + 0.01))
        simulation.command(speed, rudder)
        readings.append(simulation.advance())
    return readings


def test_sensors_agree_with_the_truth_when_they_are_perfect():
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 300, rudder=0.2)
    time = np.array([r.time for r in readings])
    rate = np.array([r.truth.velocity[2] for r in readings])
    gyro = np.array([r.imu.angular_velocity[2] for r in readings])
    np.testing.assert_allclose(gyro, rate)
    heading = np.array([r.truth.pose[2] for r in readings])
    np.testing.assert_allclose(np.gradient(heading, time)[5:-5], rate[5:-5], atol=0.1)
    angle, speed = np.array([r.rotor for r in readings]).T
    # the speed is linear between samples: the trapezoidal sum is exact
    np.testing.assert_allclose(np.diff(angle), 0.005 * (speed[1:] + speed[:-1]), atol=1e-9)


def test_the_accelerometer_tells_the_acceleration_at_its_stamp():
    """Against finite differences of the trajectory; the mean over the period before is 5 ms late and several times as far off."""
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 400, rudder=0.2)
    heading = np.array([r.truth.pose[2] for r in readings])
    cos, sin = np.cos(heading), np.sin(heading)
    u, v = np.array([r.truth.velocity[:2] for r in readings]).T
    ahead, left = np.array([r.imu.specific_force[:2] for r in readings]).T
    velocity = np.column_stack([u * cos - v * sin, u * sin + v * cos])
    felt = np.column_stack([ahead * cos - left * sin, ahead * sin + left * cos])[2:-2]
    # of fourth order in the period: by (8 (v[k+1] - v[k-1]) - (v[k+2] - v[k-2])) / (12 dt)
    change = (8 * (velocity[3:-1] - velocity[1:-3]) - (velocity[4:] - velocity[:-4])) / 0.12
    swimming = slice(50, None)
    off, size = (np.sqrt(np.mean(a[swimming] ** 2, axis=0)) for a in (felt - change, change))
    assert (off < 0.03 * size).all()
    # and what it adds up to is the way from the first velocity to the last
    assert 0.005 * np.sum(felt[1:] + felt[:-1], axis=0) == pytest.approx(
        velocity[-3] - velocity[2], abs=2e-3
    )


def test_tail_angles_bend_left_when_negative():
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 200, rudder=0.4)
    assert (
        np.mean([r.truth.tail[0] for r in readings[100:]]) < -0.2
    )  # alpha > 0 bends it to the left
    assert readings[-1].truth.pose[2] > 0.2  # and steers left


def test_stale_commands_stop_the_rotor_and_centre_the_rudder():
    simulation = Simulation(Robot(), SimulationConfig(command_timeout=0.25, stop_time=0.5))
    simulation.command(100.0, 0.4)
    followed = []
    for _ in range(100):
        followed.append((simulation.command_age, *simulation.effective_command()))
        simulation.advance()
    for age, rotor, rudder in followed:
        if age <= 0.25:
            assert (rotor, rudder) == (100.0, 0.4)
        else:
            assert rudder == 0.0
            assert rotor == pytest.approx(100 * max(0.0, 1 - (age - 0.25) / 0.5), abs=1e-9)


def test_without_any_command_the_fish_rests():
    simulation = Simulation(
        Robot(), SimulationConfig(disturbance=0.0, start_x=1.0, start_heading=0.5)
    )
    readings = [simulation.advance() for _ in range(50)]
    np.testing.assert_allclose(readings[-1].truth.pose, (1.0, 0.0, 0.5), atol=1e-12)


def test_water_disturbance_has_its_level_and_moves_the_fish():
    simulation = Simulation(Robot(), SimulationConfig(disturbance=0.01))
    pushes = []
    for _ in range(4000):
        simulation._stir_water()
        pushes.append(simulation._push.copy())
    np.testing.assert_allclose(np.std(pushes, axis=0), [0.01, 0.01, 0.0003], rtol=0.25)
    assert np.linalg.norm([simulation.advance() for _ in range(200)][-1].truth.pose) > 1e-4


def test_a_seed_gives_one_run_and_a_reset_gives_it_again():
    first, other = (Simulation(Robot(), SimulationConfig(seed=s)) for s in (3, 4))
    again = Simulation(Robot(), SimulationConfig(seed=3))
    a, b, c = (swim(s, 60)[-1] for s in (first, again, other))
    assert a.truth == b.truth
    assert a.rotor == b.rotor
    assert a.truth != c.truth
    before = first.time
    first.reset()
    assert first.time == before
    assert first.command_age == math.inf
    rerun = first.advance(), again.reset() or again.advance()
    assert rerun[0].truth == rerun[1].truth


def test_battery_is_read_once_a_second_and_the_camera_at_its_rate():
    readings = swim(Simulation(Robot(), SimulationConfig()), 500)
    assert sum(r.battery is not None for r in readings) == 5
    assert sum(len(r.camera) for r in readings) == pytest.approx(147, abs=5)


def test_an_unexplained_push_of_the_robot_file_stays_beside_the_random_one():
    robot = Robot().with_effect("disturbance", surge=0.05)
    simulation = Simulation(robot, SimulationConfig(disturbance=0.0))
    assert [simulation.advance() for _ in range(100)][-1].truth.velocity[0] > 0.02


@pytest.mark.parametrize(
    "command", [(math.nan, 0.0), (math.inf, 0.0), (2000.0, 0.0), (0.0, math.nan), (0.0, 7.0)]
)
def test_impossible_commands_are_refused_and_the_last_one_stays(command):
    simulation = Simulation(Robot(), SimulationConfig())
    simulation.command(10.0, 0.1)
    with pytest.raises(ValueError, match="expected"):
        simulation.command(*command)
    assert simulation.effective_command() == (10.0, 0.1)


def test_a_motion_that_diverges_is_reported_and_starts_again():
    simulation = Simulation(Robot(), SimulationConfig(start_x=0.5))
    simulation._state[6:12] = 1e200
    with pytest.raises(FloatingPointError, match="diverged"):
        simulation.advance()
    assert simulation.resets == 1
    assert simulation.advance().truth.pose[0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("start_x", 3.0),
        ("seed", -1),
        ("command_timeout", 0.0),
        ("real_time_factor", -1.0),
        ("camera", "both"),
    ],
)
def test_impossible_parameters_name_field_value_and_range(field, value):
    with pytest.raises(ValueError, match=rf"{field} = {value!r}: expected"):
        SimulatorConfig(**{field: value})
