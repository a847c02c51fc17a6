# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: nominal values, files, and every kind of mistake in them."""

import math
from pathlib import Path

import pytest
import yaml

from fish_sim.effects import EFFECTS
from fish_sim.effects.hull import QuadraticDrag
from fish_sim.robot import Robot, RobotError, nominal_parameters, parameter_names
from fish_sim.robot_file import load_robot, save_robot
from fish_sim.sensors import SENSOR_EFFECTS


def test_nominal_fish_is_the_published_one():
    r = Robot().parameters
    assert r["head_mass"] + 3 * r["link_mass"] + r["fin_mass"] == pytest.approx(0.535)
    assert 3 * r["link_length"] + r["fin_length"] == pytest.approx(0.100)
    assert r["fin_added_mass_sway"] == pytest.approx(4.418 * 0.03, rel=1e-4)


@pytest.mark.parametrize("links", [1, 3, 5])
def test_tail_keeps_length_mass_and_total_stiffness_whatever_the_number_of_links(links):
    r = Robot(links=links).parameters
    assert links * r["link_length"] == pytest.approx(0.07)
    assert links * r["link_mass"] == pytest.approx(0.05)
    assert r["tail_stiffness"] / links == pytest.approx(0.1 / 3)


def test_an_effect_or_a_sensor_error_can_be_taken_away_again():
    robot = Robot().with_effect("tip_slip", mobility=0.2)
    more = robot.with_effect("current", x=0.1, y=0.0).with_effect("gyro_scale", factor=1.1)
    assert more.without_effect("current").without_effect("gyro_scale") == robot
    assert robot.without_effect("current") == robot


def test_a_file_gives_back_the_robot_with_effects_and_sensors(tmp_path):
    robot = Robot(links=2, name="blue").with_parameters(head_drag_surge=0.25)
    robot = robot.with_effect("tip_slip", mobility=0.2).with_effect("camera_latency", delay=0.05)
    save_robot(
        robot, tmp_path / "model.yaml", std={"head_drag_surge": 0.01, "tip_slip.mobility": 0.02}
    )
    again = load_robot(tmp_path / "model.yaml")
    assert again == robot
    assert again.digest() == robot.digest()
    content = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert content["parameters"]["head_drag_surge"]["std"] == 0.01
    assert content["effects"]["tip_slip"]["mobility"] == {
        "value": 0.2,
        "unit": "m/(N s)",
        "std": 0.02,
        "source": "identified or set by the user",
    }
    assert all(row["unit"] and row["source"] for row in content["parameters"].values())


def test_digest_tells_robots_apart_by_motion_and_not_by_name():
    robot = Robot()
    assert Robot(name="other").digest() == robot.digest()
    assert robot.with_parameters(head_mass=0.5).digest() != robot.digest()
    assert robot.with_effect("current").digest() != robot.digest()


def test_vector_follows_the_parameter_names():
    robot = (
        Robot().with_effect("rudder_lag", time_constant=0.1).with_effect("tip_slip", mobility=0.2)
    )
    names = parameter_names(robot.structure)
    assert dict(zip(names, robot.vector(), strict=True))["tip_slip.mobility"] == 0.2
    own = EFFECTS["tip_slip"], EFFECTS["rudder_lag"]
    assert robot.structure == (3, own)  # table order, not the order of adding


def test_a_table_of_ones_own_adds_an_effect_to_one_robot_alone():
    class Mine(QuadraticDrag):
        name = "mine"

    robot = Robot(table={**EFFECTS, "mine": Mine}).with_effect("mine", surge=0.6)
    assert robot.structure == (3, (Mine,))
    assert "mine.surge" in parameter_names(robot.structure)
    with pytest.raises(RobotError, match="unknown effect 'mine'"):
        Robot().with_effect("mine")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Robot(links=0), ["links", "0", "1 to 12"]),
        (lambda: Robot(links=2.5), ["links", "2.5"]),
        (lambda: Robot(parameters={"head_mass": -1.0}), ["parameters.head_mass", "-1.0", "kg"]),
        (lambda: Robot(parameters={"head_mass": math.nan}), ["parameters.head_mass", "nan"]),
        (lambda: Robot(parameters={"head_mass": True}), ["parameters.head_mass", "True"]),
        (
            lambda: Robot(parameters={"head_mas": 1.0}),
            ["parameters.head_mas", "unknown", "head_mass"],
        ),
        (lambda: Robot(effects={"darg": {}}), ["darg", "known", "quadratic_drag"]),
        (lambda: Robot(effects={"current": {"z": 1.0}}), ["effects.current.z", "known: x, y"]),
        (lambda: Robot(effects={"current": {"x": math.inf}}), ["effects.current.x", "inf"]),
        (lambda: Robot(sensors={"current": {}}), ["sensors", "current", "camera_latency"]),
    ],
)
def test_impossible_robots_are_refused_with_name_and_value(make, words):
    with pytest.raises(RobotError) as error:
        make()
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2", ["cannot be read as YAML"]),
        ("format: 2020-13-45", ["cannot be read as YAML"]),
        ("3", ["int", "table"]),
        ("format: 2", ["format", "2", "expected 1"]),
        ("format: 1\ncolour: blue", ["colour", "unknown field"]),
        ("format: 1\n7: 8\ncolour: blue\nnull: 9", ["7: unknown field"]),
        ("format: 1\nlinks: many", ["links", "many"]),
        ("format: 1\nparameters: [1]", ["parameters", "[1]"]),
        ("format: 1\nparameters: {head_mass: heavy}", ["parameters.head_mass", "heavy"]),
        ("format: 1\nparameters: {head_inertia: 1e-3}", ["head_inertia", "1.0e-3"]),
        (
            f"format: 1\nparameters: {{head_mass: 1{'0' * 400}}}",
            ["parameters.head_mass", "beyond every float"],
        ),
        (
            f"format: 1\nsensors: {{gyro_scale: {{factor: 0x{'f' * 9999}}}}}",
            ["gyro_scale.factor", "[0.5, 2] 1"],
        ),
        ("format: 1\nparameters: {head_mass: {unit: kg}}", ["parameters.head_mass", "value"]),
        (
            "format: 1\nparameters: {head_mass: {value: 465, unit: g}}",
            ["head_mass.unit", "'g'", "'kg'"],
        ),
        ("format: 1\neffects: [current]", ["effects", "current", "table"]),
        ("format: 1\neffects: {darg: {}}", ["darg", "known"]),
        (
            "format: 1\neffects: {tip_slip: {mobility: {value: 1, unit: m}}}",
            ["tip_slip.mobility.unit", "'m'"],
        ),
    ],
)
def test_broken_files_name_file_field_and_expectation(tmp_path, text, words):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(RobotError) as error:
        load_robot(path)
    assert all(word in str(error.value) for word in ["robot.yaml", *words]), error.value


def test_a_missing_file_and_a_picture_are_refused_in_one_line(tmp_path):
    with pytest.raises(RobotError, match=r"nowhere.yaml"):
        load_robot(tmp_path / "nowhere.yaml")
    (tmp_path / "robot.yaml").write_bytes(b"\xff\xd8\xff\xe0 jpeg")
    with pytest.raises(RobotError, match="cannot be read"):
        load_robot(tmp_path / "robot.yaml")


def test_every_effect_and_sensor_effect_can_be_enabled_by_name_alone():
    for name in (*EFFECTS, *SENSOR_EFFECTS):
        robot = Robot().with_effect(name)
        assert name in (robot.effects if name in EFFECTS else robot.sensors)


def test_shipped_robot_file_is_the_nominal_robot():
    shipped = load_robot(Path(__file__).parent.parent / "config" / "robot.yaml")
    assert shipped == Robot(name="nominal fish")
    assert list(shipped.parameters) == list(nominal_parameters())
