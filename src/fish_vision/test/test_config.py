"""Parameters of the tracker."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_vision.config import TrackerConfig, config_from_file

FILE = Path(__file__).parents[1] / "config" / "tracker.yaml"


def test_file_has_exactly_the_parameters_and_their_defaults() -> None:
    values = yaml.safe_load(FILE.read_text())["/**"]["ros__parameters"]
    defaults = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(TrackerConfig()).items()}
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
    ],
)
def test_a_bad_value_is_refused_with_its_name(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        TrackerConfig(**{field: value})


@pytest.mark.parametrize("text", [None, "", "a: 1", "/**: {ros__parameters: {colour_of_front: 3}}", "a: ["])
def test_a_file_that_is_no_params_file_is_refused_with_its_name(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "params.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match="params.yaml"):
        config_from_file(path)
