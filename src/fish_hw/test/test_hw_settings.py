# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings: their YAML files, and what they refuse."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_hw.settings import (
    CameraSettings,
    FakeRobotSettings,
    ImuSettings,
    RotorSettings,
    RudderSettings,
)

SETTINGS = {
    "rotor": RotorSettings,
    "rudder": RudderSettings,
    "imu": ImuSettings,
    "camera": CameraSettings,
    "fake_robot": FakeRobotSettings,
}
CONFIG = Path(__file__).parents[1] / "config"


@pytest.mark.parametrize("name", SETTINGS)
def test_yaml_has_every_parameter_with_its_default(name):
    document = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())
    assert document["/**"]["ros__parameters"] == asdict(SETTINGS[name]())


@pytest.mark.parametrize(
    ("settings", "field", "value", "expected"),
    [
        (RotorSettings, "sign", 0, "sign is 0, expected one of 1, -1"),
        (
            RotorSettings,
            "leak_level",
            "wet",
            "leak_level is 'wet', expected one of 'low', 'high'",
        ),
        (RotorSettings, "stale_s", 5.0, "stale_s is 5.0, expected 0.03 to 1.0"),
        (RotorSettings, "cell_warn_v", 3.0, "cell_warn_v is 3.0, expected 3.3 to 5.0"),
        (RotorSettings, "max_velocity", float("nan"), "max_velocity is nan"),
        (RudderSettings, "backend", "gpio", "backend is 'gpio', expected one of 'sysfs'"),
        (RudderSettings, "centre_us", 2100.0, "centre_us is 2100.0, expected 1000.0 to 2000.0"),
        (ImuSettings, "address", 0x28, "address is 40, expected one of 74, 75"),
        (CameraSettings, "jpeg_quality", 0, "jpeg_quality is 0, expected 1 to 100"),
    ],
)
def test_refusals_name_field_value_and_range(settings, field, value, expected):
    with pytest.raises(ValueError, match=expected):
        settings(**{field: value})


@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 200.0])
def test_rotor_times_leave_room_for_three_cycles(rate_hz):
    least = 3 / rate_hz
    RotorSettings(rate_hz=rate_hz, stale_s=least, module_timeout_s=max(least, 0.05))
    for field in ("stale_s", "module_timeout_s"):
        with pytest.raises(ValueError, match=f"{field} is .* expected"):
            RotorSettings(rate_hz=rate_hz, **{field: 0.9 * least})


def test_rotor_limits_let_full_throttle_through():
    """A^2 w^4 = S_max = (12 rad (2 pi 2 Hz)^2)^2 at f = 2 Hz: the shared model's largest command."""
    w = 2 * 3.141592653589793 * 2.0
    assert RotorSettings().max_velocity > 12.0 * w
    assert RotorSettings().max_acceleration > 12.0 * w**2
