# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The picture of the fish has the geometry of the model."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

PACKAGE = Path(__file__).parents[1]
ROBOT = PACKAGE.parent / "fish_sim" / "config" / "robot.yaml"
Array = NDArray[np.float64]


def expand(links: int, robot: Path = ROBOT) -> ElementTree.Element:
    """The URDF that xacro makes of the file."""
    program = Path(sys.executable).parent / "xacro"
    if not program.exists():
        pytest.skip("xacro is not installed (requirements-dev.txt)")
    words = [
        program,
        PACKAGE / "urdf" / "fish.urdf.xacro",
        f"robot:={robot}",
        f"tail_links:={links}",
    ]
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ElementTree.fromstring(done.stdout)


def place(urdf: ElementTree.Element, link: str, angles: dict[str, float]) -> Array:
    """Homogeneous transform (4, 4) of a link in base_link."""
    for joint in urdf.iter("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        assert child is not None
        assert parent is not None
        if child.attrib["link"] != link:
            continue
        origin, axis = joint.find("origin"), joint.find("axis")
        own = np.eye(4)
        if origin is not None:
            own[:3, 3] = [float(x) for x in origin.attrib["xyz"].split()]
        turn = angles.get(joint.attrib["name"], 0.0)
        if axis is not None and turn:
            turn *= float(axis.attrib["xyz"].split()[2])
            own[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        return place(urdf, parent.attrib["link"], angles) @ own
    assert link == "base_link", f"{link} hangs on nothing"
    return np.eye(4)


@pytest.mark.parametrize("links", [1, 2, 3, 5])
def test_the_tip_is_where_the_model_has_it(links: int) -> None:
    """r_tip = -hinge e(0) - sum_i link_length e(theta_i) - fin_length e(theta_n), e(a) = (cos a, sin a)."""
    model = {k: v["value"] for k, v in yaml.safe_load(ROBOT.read_text())["parameters"].items()}
    relative = np.linspace(-0.4, 0.3, links)
    theta = np.cumsum(relative)
    e = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    tail = 3 * model["link_length"]  # robot.yaml has three links
    wanted = -np.array([model["hinge_offset"], 0.0])
    wanted = wanted - tail / links * e.sum(axis=0) - model["fin_length"] * e[-1]
    angles = {f"tail_{k + 1}": float(a) for k, a in enumerate(relative)}
    found = place(expand(links), "tip", angles)[:2, 3]
    assert found == pytest.approx(wanted, abs=1e-9)


def test_a_rudder_to_the_left_turns_its_horn_as_the_resting_tail() -> None:
    urdf = expand(3)
    horn = place(urdf, "rudder_link", {"rudder": 0.3})
    tail = place(urdf, "link_1", {"tail_1": -0.3})
    assert horn[:2, :2] == pytest.approx(tail[:2, :2])


def test_sensors_and_markers_are_fixed_to_the_head() -> None:
    urdf = expand(3)
    moved = {"rotor": 1.0, "rudder": 0.2, "tail_1": 0.3}
    assert place(urdf, "imu_link", moved) == pytest.approx(np.eye(4))
    assert place(urdf, "front_marker", moved)[:2, 3] == pytest.approx([0.045, 0.0])
    assert place(urdf, "rear_marker", moved)[:2, 3] == pytest.approx([-0.045, 0.0])


def test_every_joint_is_one_that_the_node_publishes() -> None:
    moving = {j.attrib["name"] for j in expand(3).iter("joint") if j.attrib["type"] != "fixed"}
    assert moving == {"rotor", "rudder", "tail_1", "tail_2", "tail_3"}
