# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the camera node."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_sim.camera import CameraConfig

FILE = Path(__file__).parents[1] / "config" / "camera.yaml"


def test_file_has_exactly_the_parameters_and_their_defaults() -> None:
    values = yaml.safe_load(FILE.read_text())["/**"]["ros__parameters"]
    defaults = {
        k: list(v) if isinstance(v, tuple) else v for k, v in asdict(CameraConfig()).items()
    }
    assert values.keys() == defaults.keys()
    for key, value in values.items():
        assert value == pytest.approx(defaults[key]), key


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rate_hz", 0.0),
        ("drop_rate", 1.5),
        ("latency_s", -0.1),
        ("jpeg_quality", 0),
        ("focal", (1000.0,)),
        ("distortion", (0.1, float("nan"), 0.0, 0.0, 0.0)),
        ("focal", (-1.0, 1000.0)),
        ("camera_position", (0.0, 0.0, 0.0)),
        ("noise_std", float("nan")),
    ],
)
def test_a_bad_value_is_refused_with_its_name(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        CameraConfig(**{field: value})
