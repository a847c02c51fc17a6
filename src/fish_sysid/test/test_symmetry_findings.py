# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What breaks a symmetry is found with its size, nothing is found in nulls, and lacking data are said to lack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kinematic_swims import World, kinematic_swims

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_current, with_image_age
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import GIVEN, symmetry_findings
from fish_sysid.diagnosis.symmetry.symmetry_json import stated

FLOW = (0.03, -0.02)


def answers(experiment: Experiment, robot: Robot | None = None) -> dict[str, SymmetryFinding]:
    return {f.name: f for f in symmetry_findings(experiment, robot or Robot())}


@pytest.fixture(scope="module")
def null() -> Experiment:
    return kinematic_swims(World())


@pytest.mark.parametrize(
    ("world", "name", "truth", "floor"),
    [
        (World(flow=FLOW), "current", {"x": 0.03, "y": -0.02}, 0.0003),
        (World(gyro_factor=1.05), "gyro_scale", {"factor": 1.05}, 0.001),
        (World(camera_factor=1.1), "camera_scale", {"factor": 1.1}, 0.005),
        (World(imu_angle=0.15), "imu_misalignment", {"angle": 0.15}, 0.005),
        (World(heading_offset=0.08), "camera_heading_offset", {"offset": 0.08}, 0.002),
        (World(shear=0.06), "nonuniform_current", {"shear_x": 0.06, "strain": 0.0}, 0.001),
        (World(encoder_steps=5), "encoder behind the command", {"delay": 0.05}, 0.001),
    ],
)
def test_what_is_hidden_comes_back_within_its_errors(world, name, truth, floor):
    found = answers(kinematic_swims(world, seed=1))[name]
    assert found.status == "found"
    for key, value in truth.items():
        estimate = found.parameters[key]
        assert estimate.value == pytest.approx(value, abs=4.0 * estimate.std + floor)
        assert estimate.std < max(0.3 * abs(value), 0.02)


def test_old_images_are_found_and_the_flow_beside_them(null):
    found = answers(with_image_age(with_current(null, FLOW), 0.07))
    assert found["camera_latency"].status == "found"
    assert found["camera_latency"].parameters["delay"].value == pytest.approx(0.07, abs=0.011)
    assert found["current"].status == "found"
    assert found["current"].parameters["x"].value == pytest.approx(0.03, abs=0.001)


@pytest.mark.parametrize("seed", range(50))
def test_nothing_is_stated_where_nothing_is_hidden(seed):
    """Every draw has its own trials, speeds and programs; short ones, of which the least is known."""
    drawn = kinematic_swims(World(), seed=100 + seed, trials=5, duration=10.0)
    assert [f.name for f in symmetry_findings(drawn, Robot()) if f.status == "found"] == []


def test_an_injected_current_moves_the_flow_by_exactly_that(null):
    before, after = answers(null), answers(with_current(null, FLOW))
    for key, step in zip("xy", FLOW, strict=True):
        one, other = before["current"].parameters[key], after["current"].parameters[key]
        assert other.value - one.value == pytest.approx(step, abs=1e-9)
        assert other.std == pytest.approx(one.std, rel=1e-6)
    for name in ("camera_latency", "encoder behind the command", "gyro_scale"):
        assert after[name] == before[name]
    for name in ("camera_scale", "imu_misalignment"):  # a uniform motion is no acceleration
        for key, estimate in before[name].parameters.items():
            assert after[name].parameters[key].value == pytest.approx(estimate.value, abs=1e-9)


def test_a_mirrored_pool_has_a_mirrored_flow():
    """y, heading, rudder and rates change sign: so does the flow across, and nothing else."""
    made = kinematic_swims(World(flow=FLOW), seed=3)
    sides = np.array([1.0, -1.0])
    frames = tuple(replace(f, pose=f.pose * [1.0, -1.0, -1.0]) for f in made.frames)
    mirrored = replace(
        made,
        commands=made.commands * sides,
        gyro=-made.gyro,
        accel=made.accel * sides,
        frames=frames,
    )
    one, other = (answers(e)["current"].parameters for e in (made, mirrored))
    assert other["x"].value == pytest.approx(one["x"].value, abs=1e-6)
    assert other["y"].value == pytest.approx(-one["y"].value, abs=1e-6)


def without(experiment: Experiment, *sensors: str) -> Experiment:
    return replace(experiment, **{s: np.full_like(getattr(experiment, s), np.nan) for s in sensors})


@pytest.mark.parametrize(
    ("world", "lacking", "name", "reason"),
    [
        (World(turns=False, one_heading=True), (), "current", "too few headings"),
        (World(turns=False, one_heading=True), (), "camera_heading_offset", "too few headings"),
        (World(), ("gyro",), "camera_latency", "no gyro"),
        (World(), ("gyro",), "gyro_scale", "no gyro"),
        (World(), ("gyro",), "IMU beside the command", "no gyro"),
        (World(), ("accel",), "camera_scale", "no IMU"),
        (World(), ("encoder",), "encoder behind the command", "no encoder"),
        (World(turns=False, swing=0.0), (), "camera_latency", "no turns"),
        (World(turns=False), (), "gyro_scale", "no turns"),
        (World(turns=False, speeds=(60.0, 60.0)), (), "imu_misalignment", "no turns and one speed"),
        (World(turns=False), (), "left and right differ", "the rudder is left in 0%"),
        (World(speeds=(1.0, 2.0)), (), "camera_heading_offset", "no course"),
        (World(), (), "IMU beside the command", "the rotor starts from rest"),
        (World(speeds=(1.0, 2.0)), (), "encoder behind the command", "the rotor changes in fewer"),
        (World(speeds=(1.0, 2.0), turns=False, flow=(0.0, 0.0)), (), "wall_effect", "near a wall"),
    ],
)
def test_what_the_recordings_cannot_tell_is_said_with_the_reason(world, lacking, name, reason):
    found = answers(without(kinematic_swims(world), *lacking))[name]
    assert found.status == "cannot tell"
    assert reason in found.reason
    assert found.needs


def test_a_fish_that_walls_slow_down_is_told_with_how_much():
    swims = kinematic_swims(World(wall=0.5, turns=False), seed=4, trials=8, duration=12.0)
    found = answers(swims)["wall_effect"]
    assert found.status == "found"
    assert found.parameters["slowdown"].value == pytest.approx(0.5, abs=0.15)


def test_walls_are_not_judged_where_the_camera_sees_the_fish_beyond_them(null):
    found = answers(with_current(null, (0.3, 0.0)))["wall_effect"]
    assert found.status == "cannot tell"
    assert "beyond the walls" in found.reason


def test_of_two_trials_nothing_is_told(null):
    for found in symmetry_findings(null.select([0, 1]), Robot()):
        assert found.status == "cannot tell", found.name


def test_a_gyro_that_answers_the_rotor_within_a_stroke_is_in_time():
    late = kinematic_swims(World(wait=1.5))
    assert answers(late)["IMU beside the command"].status == "not found"
    early = replace(late, gyro=np.roll(late.gyro, -20, axis=0))
    answer = answers(early)["IMU beside the command"]
    assert answer.status == "found"
    assert answer.parameters["answer"].value == pytest.approx(-0.2, abs=0.05)


def test_mirror_symmetry_alone_names_nothing():
    slipping = without(kinematic_swims(World(heading_offset=0.08), seed=1), "accel")
    findings = symmetry_findings(slipping, Robot())
    found = [f.name for f in findings if f.status == "found"]
    assert found == ["camera_heading_offset", "left and right differ"]
    assert stated(findings) == []


@pytest.mark.parametrize(
    ("world", "names"),
    [
        (World(heading_offset=0.15), ["camera_heading_offset"]),
        (World(imu_angle=0.15), ["imu_misalignment"]),
        (World(heading_offset=0.15, imu_angle=0.2), []),
    ],
)
def test_course_and_accelerometer_together_tell_marker_from_imu(world, names):
    """An angle between the two is the marker's where the course shows the same, the IMU's where it shows none."""
    findings = symmetry_findings(kinematic_swims(world, seed=2, trials=8), Robot())
    assert [f.name for f in stated(findings)] == names


def test_what_the_given_robot_has_is_found_and_not_stated(null):
    robot = Robot().with_effect("current", x=0.03, y=-0.02)
    found = answers(with_current(null, FLOW), robot)["current"]
    assert found.status == "found"
    assert found.reason == GIVEN
    assert stated([found]) == []
