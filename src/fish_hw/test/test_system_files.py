# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files for the robot's computer: the tools that read them accept them, and they name what exists."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEM = Path(__file__).parents[1] / "system"
UNIT = (SYSTEM / "fish-drivers.service").read_text()
RULE = re.compile(r'[A-Z]+(\{\w+\})?(==|!=|=|\+=|-=|:=)"[^"]*"')


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
