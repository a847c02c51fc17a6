# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The package as a whole: who may import what, the settings and their YAML files, and files for the robot's computer, which the
tools that read them accept.
"""

import ast
import re
import shutil
import subprocess
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

PACKAGE = Path(__file__).parents[1] / "fish_hw"
LAYERS = {
    "settings": set(),
    "protocol": {"protocol"},
    "transport": {"transport", "settings"},
    "devices": {"devices", "protocol", "transport", "settings"},
    "emulators": {"emulators", "devices", "protocol", "transport", "settings"},
    "safe_stop": {"devices", "transport", "settings"},
    "nodes": {"nodes", "emulators", "devices", "protocol", "transport", "settings"},
}
PORTS = {"serial", "smbus2"}
ROS = {
    "rclpy",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "diagnostic_msgs",
    "builtin_interfaces",
    "rcl_interfaces",
}
OTHERS = {
    "fish_sim",
    "fish_vision",
    "fish_control",
    "fish_train",
    "fish_bag",
    "fish_sysid",
    "fish_bringup",
}
FILES = sorted(PACKAGE.rglob("*.py"))

SETTINGS = {
    "rotor": RotorSettings,
    "rudder": RudderSettings,
    "imu": ImuSettings,
    "camera": CameraSettings,
    "fake_robot": FakeRobotSettings,
}
CONFIG = Path(__file__).parents[1] / "config"

SYSTEM = Path(__file__).parents[1] / "system"
UNIT = (SYSTEM / "fish-drivers.service").read_text()
RULE = re.compile(r'[A-Z]+(\{\w+\})?(==|!=|=|\+=|-=|:=)"[^"]*"')


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports(path):
    layer = path.relative_to(PACKAGE).with_suffix("").parts[0]
    names = imports(path)
    roots = {name.split(".")[0] for name in names}
    assert not roots & OTHERS
    assert layer == "transport" or not roots & PORTS
    assert layer == "nodes" or not roots & ROS
    own = {name.split(".")[1] for name in names if name.startswith("fish_hw.")}
    assert own <= LAYERS.get(layer, set())


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


def tool_has(*command: str) -> bool:
    """Whether a program is there and knows a subcommand."""
    if shutil.which(command[0]) is None:
        return False
    return subprocess.run([*command, "--help"], capture_output=True).returncode == 0


@pytest.mark.skipif(not tool_has("systemd-analyze", "verify"), reason="no systemd-analyze here")
def test_systemd_accepts_the_unit():
    command = ["systemd-analyze", "verify", "--recursive-errors=no", "--man=no"]
    result = subprocess.run(
        [*command, str(SYSTEM / "fish-drivers.service")], capture_output=True, text=True
    )
    complaints = [line for line in result.stderr.splitlines() if "fish-drivers" in line]
    assert complaints == []


def test_the_unit_stops_rotor_and_rudder_whatever_ended_the_drivers():
    stop = re.search(r"^ExecStopPost=.*$", UNIT, re.MULTILINE)[0]
    assert "ros2 run fish_hw safe_stop" in stop
    assert "--rotor " in stop
    assert "--rudder " in stop
    assert re.search(r"^ExecStart=.*ros2 launch fish_hw drivers.launch.py", UNIT, re.MULTILINE)
    assert re.search(r"^Restart=always$", UNIT, re.MULTILINE)


@pytest.mark.skipif(
    not tool_has("udevadm", "verify"), reason="no udevadm verify here (systemd 254)"
)
def test_udev_accepts_the_rules():
    command = ["udevadm", "verify", "--resolve-names=never", str(SYSTEM / "99-fish.rules")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


def test_every_udev_rule_is_a_list_of_keys_with_operators():
    rules = [
        line.removeprefix("# ")
        for line in (SYSTEM / "99-fish.rules").read_text().splitlines()
        if "==" in line
    ]
    assert len(rules) == 4
    for rule in rules:
        for part in re.split(r", (?=[A-Z])", rule):
            assert RULE.fullmatch(part), part
