# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the tracker."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_vision.config import TrackerConfig, config_from_file

FILE = Path(__file__).parents[1] / "config" / "tracker.yaml"


def test_file_has_exactly_the_parameters_and_their_defaults() -> None:
    values = yaml.safe_load(FILE.read_text())["/**"]["ros__parameters"]
    defaults = {
        k: list(v) if isinstance(v, tuple) else v for k, v in asdict(TrackerConfig()).items()
    }
    assert values.keys() == defaults.keys()
    for key, value in values.items():
        assert value == pytest.approx(defaults[key]), key
    assert config_from_file(FILE).camera_tilt == TrackerConfig().camera_tilt


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("front_colour", (20, 200, 100, 100)),
        ("rear_colour", (20, 40, 300, 100)),
        ("tail_odd_colour", (20, 40, 100)),
        ("camera_tilt", (0.0, 0.0)),
        ("camera_position", (0.0, 0.0, float("inf"))),
        ("area_min", 0.0),
        ("tail_links", 20),
        ("front_marker", (-0.03, 0.0)),
        ("marker_kind", "barcodes"),
        ("tag_dictionary", "9X9"),
        ("head_tag", 50),
        ("head_tag", 2),  # the tail's
        ("first_tail_tag", 48),
        ("lowpass_hz", -1.0),
    ],
)
def test_a_bad_value_is_refused_with_its_name(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        TrackerConfig(**{field: value})


ALL = "/**:\n  ros__parameters: {camera_tilt: [0, 0.1, 0], pixel_std: 0.03}\n"
OWN = "/fish/tracker:\n  ros__parameters: {pixel_std: 0.07, max_speed: 2}\n"


@pytest.mark.parametrize(
    ("text", "pixel_std"), [(ALL + OWN, 0.07), (OWN + ALL, 0.03)], ids=["own last", "all last"]
)
def test_the_two_parts_of_a_file_are_merged(tmp_path: Path, text: str, pixel_std: float) -> None:
    """As ROS does: test_tracker_node compares with the node."""
    path = tmp_path / "params.yaml"
    path.write_text(text + "/fish/camera:\n  ros__parameters: {device: emulator}\n")
    config = config_from_file(path)
    assert (config.pixel_std, config.camera_tilt, config.max_speed) == (
        pixel_std,
        (0.0, 0.1, 0.0),
        2.0,
    )


def test_ros_s_own_parameters_are_no_mistake_and_another_robot_s_are_not_taken(
    tmp_path: Path,
) -> None:
    """As in safe_stop: both read a file through fish_node."""
    path = tmp_path / "params.yaml"
    path.write_text("/**/tracker:\n  ros__parameters: {use_sim_time: true, pixel_std: 0.03}\n")
    assert config_from_file(path).pixel_std == 0.03
    path.write_text(
        "/**/tracker:\n  ros__parameters: {}\n/red/fish/tracker:\n  ros__parameters: {}\n" + OWN
    )
    with pytest.raises(ValueError, match=r"/fish/tracker does not read /red/fish/tracker"):
        config_from_file(path)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("tail_links: 3.0", "tail_links is 3.0, expected int such as 3"),
        ("front_colour: [a, 36, 110, 90]", "front_colour is 'a', expected int"),
        ("front_colour: 20", "front_colour is 20, expected tuple"),
        ("pixel_std: fast", "pixel_std is 'fast', expected float"),
        ("use_raw: 1", "use_raw is 1, expected bool"),
        ("max_speed: true", "max_speed is True, expected float"),
    ],
)
def test_a_value_of_the_wrong_type_is_refused_with_its_name(
    tmp_path: Path, setting: str, message: str
) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(f"/**: {{ros__parameters: {{{setting}}}}}")
    with pytest.raises(ValueError, match=message):
        config_from_file(path)


@pytest.mark.parametrize(
    "text",
    [
        None,
        "",
        "a: 1",
        "[]",
        "/**: 3",
        "/**: {ros__parameters: 3}",
        "/**: {ros__parameters: {colour_of_front: 3}}",
        "a: [",
    ],
)
def test_a_file_that_is_no_params_file_is_refused_with_its_name(
    tmp_path: Path, text: str | None
) -> None:
    path = tmp_path / "params.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=r"params.yaml"):
        config_from_file(path)
