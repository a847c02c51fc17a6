# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The description of the fish, and the node that moves its joints."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import rclpy
import yaml
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from fish_description.joint_angles import JointAngles, JointAnglesConfig, tail_names
from fish_description.nodes.joint_angles import JointAnglesNode


@pytest.fixture
def joints() -> JointAngles:
    return JointAngles(JointAnglesConfig())


def test_a_fish_of_which_nothing_is_known_is_straight(joints: JointAngles) -> None:
    names = ("rotor", "rudder", "tail_1", "tail_2", "tail_3")
    assert joints.angles(0.0) == dict.fromkeys(names, 0.0)


def test_the_tail_rests_against_the_rudder_where_no_camera_sees_it(joints: JointAngles) -> None:
    joints.command(["rotor", "rudder"], [1.5, 0.3])
    assert joints.angles(0.0) == {
        "rotor": 0.0,
        "rudder": 0.3,
        "tail_1": -0.3,
        "tail_2": 0.0,
        "tail_3": 0.0,
    }


def test_what_the_camera_sees_counts_until_it_is_old(joints: JointAngles) -> None:
    joints.command(["rudder"], [0.2])
    joints.camera(["tail_1", "tail_2"], [-0.5, 0.1], now=10.0)
    assert joints.angles(10.5)["tail_1"] == -0.5
    assert joints.angles(10.5)["tail_3"] == 0.0
    assert joints.angles(10.51)["tail_1"] == -0.2


def test_the_rotor_is_measured_and_stays_within_one_turn(joints: JointAngles) -> None:
    joints.command(["rotor"], [2.0])  # a phase of the stroke
    assert joints.angles(0.0)["rotor"] == 0.0
    joints.encoder(["rotor"], [0.5 + 6 * math.pi])
    assert joints.angles(0.0)["rotor"] == pytest.approx(0.5)


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_what_is_not_finite_is_left_out(joints: JointAngles, angle: float) -> None:
    joints.encoder(["rotor"], [1.0])
    joints.encoder(["rotor"], [angle])
    joints.command(["rotor", "rudder"], [0.0])  # a message without the rudder's position
    joints.command(["rudder"], [angle])
    joints.camera(["tail_1"], [angle], now=0.0)
    assert joints.angles(0.0)["rotor"] == 1.0
    assert joints.angles(0.0)["tail_1"] == 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("rate_hz", 0.0), ("rate_hz", math.nan), ("tail_links", 0), ("tail_timeout", -1.0)],
)
def test_a_parameter_out_of_range_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{name}: got .*; expected"):
        JointAnglesConfig(**{name: value})


def test_names_are_those_of_the_tracker() -> None:
    assert tail_names(2) == ("tail_1", "tail_2")


DOMAIN = 164
SPINS = 500  # turns of 20 ms that a message may take


@pytest.fixture
def spin() -> Iterator[Callable[[Callable[[], bool]], bool]]:
    """Both nodes in one executor; spin(done) turns it until done() or for SPINS turns."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    executor = SingleThreadedExecutor(context=context)
    nodes = [JointAnglesNode(context=context), Node("peer", namespace="fish", context=context)]
    for node in nodes:
        executor.add_node(node)

    def until(done: Callable[[], bool]) -> bool:
        return any(done() or executor.spin_once(0.02) or False for _ in range(SPINS))

    until.peer = nodes[1]  # type: ignore[attr-defined]
    yield until
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_three_topics_become_one_message(spin: Callable[[Callable[[], bool]], bool]) -> None:
    peer: Node = spin.peer  # type: ignore[attr-defined]
    heard: list[JointState] = []
    peer.create_subscription(JointState, "description/joint_states", heard.append, 10)
    encoder = peer.create_publisher(JointState, "joint_states", 10)
    command = peer.create_publisher(JointState, "joint_command", 10)
    tail = peer.create_publisher(JointState, "camera/tail", 10)

    def complete() -> bool:
        encoder.publish(JointState(name=["rotor"], position=[0.7], velocity=[3.0]))
        command.publish(JointState(name=["rotor", "rudder"], position=[2.0, 0.25]))
        tail.publish(JointState(name=["tail_1", "tail_2"], position=[-0.4, 0.1]))
        return bool(heard) and list(heard[-1].position) == [0.7, 0.25, -0.4, 0.1, 0.0]

    assert spin(complete)
    assert list(heard[-1].name) == ["rotor", "rudder", "tail_1", "tail_2", "tail_3"]


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
