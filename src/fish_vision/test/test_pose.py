# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Markers to pose: exact recovery, covariance against finite differences, identities."""

from math import cos, pi, sin

import numpy as np
import pytest

from fish_vision.pose import (
    HeadPose,
    MarkerLayout,
    Spot,
    head_pose,
    tail_angles,
    tail_sides,
    wrap,
)

LAYOUT = MarkerLayout((0.045, 0.0), (-0.045, 0.0), 0.075, 0.0233)
ODD = MarkerLayout((0.06, 0.012), (-0.03, -0.004), 0.075, 0.0233)


def spot(x: float, y: float, std: float = 1e-4) -> Spot:
    return Spot(np.array([x, y]), np.eye(2) * std**2)


def seen(pose: tuple[float, float, float], layout: MarkerLayout) -> tuple[Spot, Spot]:
    x, y, psi = pose
    R = np.array([[cos(psi), -sin(psi)], [sin(psi), cos(psi)]])
    return tuple(spot(*(np.array([x, y]) + R @ np.array(m))) for m in (layout.front, layout.rear))


@pytest.mark.parametrize("layout", [LAYOUT, ODD])
@pytest.mark.parametrize("heading", [-3.1, -pi / 2, 0.0, 1.0, 3.1])
def test_pose_is_recovered(layout: MarkerLayout, heading: float) -> None:
    head = head_pose(*seen((0.3, -0.8, heading), layout), layout)
    assert (head.x, head.y) == pytest.approx((0.3, -0.8))
    assert wrap(head.heading - heading) == pytest.approx(0.0)


@pytest.mark.parametrize("layout", [LAYOUT, ODD])
def test_covariance_is_that_of_the_markers_carried_through_the_pose(layout: MarkerLayout) -> None:
    """J S J^T with J from central differences of the pose."""
    front, rear = seen((0.3, -0.8, 0.7), layout)
    a, b = np.array([[2.0, 0.5], [0.5, 1.0]]) * 1e-7, np.array([[1.0, -0.3], [-0.3, 3.0]]) * 1e-7

    def pose(shift: np.ndarray) -> np.ndarray:
        head = head_pose(
            Spot(front.position + shift[:2], a), Spot(rear.position + shift[2:], b), layout
        )
        return np.array([head.x, head.y, head.heading])

    h = 1e-6
    J = np.column_stack([(pose(h * axis) - pose(-h * axis)) / (2 * h) for axis in np.eye(4)])
    S = np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), b]])
    stated = head_pose(Spot(front.position, a), Spot(rear.position, b), layout).covariance
    np.testing.assert_allclose(stated, J @ S @ J.T, rtol=1e-6)


def test_spacing_is_the_distance_of_the_markers_however_they_sit() -> None:
    front, rear = seen((0.3, -0.8, 0.7), ODD)
    assert ODD.spacing == pytest.approx(float(np.linalg.norm(front.position - rear.position)))


def test_an_uncertain_marker_pulls_the_head_less() -> None:
    """The markers are seen 2 mm too far apart; the rear one is ten times as uncertain."""
    front, rear = spot(0.046, 0.0, 1e-4), spot(-0.046, 0.0, 1e-3)
    head = head_pose(front, rear, LAYOUT)
    assert head.x == pytest.approx(0.001 - 0.002 / 101, abs=1e-7)


def chain(pose: tuple[float, float, float], relative: list[float]) -> list[Spot]:
    x, y, angle = pose
    place = np.array([x, y]) - 0.075 * np.array([cos(angle), sin(angle)])
    spots = []
    for bend in relative:
        angle += bend
        place = place - 0.0233 * np.array([cos(angle), sin(angle)])
        spots.append(spot(*place))
    return spots


@pytest.mark.parametrize("relative", [[0.0, 0.0, 0.0], [0.4, -0.2, 0.3], [-0.8, -0.3, -0.3]])
def test_tail_angles_are_recovered(relative: list[float]) -> None:
    pose = (0.5, 0.1, 3.0)
    one, two, three = chain(pose, relative)
    red, green = [three, one], [two]  # links 1 and 3 share a colour
    angles = tail_angles(HeadPose(*pose, np.eye(3)), [red, green, red], LAYOUT, 0.008)
    assert angles == pytest.approx(relative)


def test_a_tail_marker_to_the_left_counts_negative() -> None:
    left = [[spot(-0.075 - 0.0233 * cos(0.5), 0.0233 * sin(0.5))]]
    assert tail_angles(HeadPose(0, 0, 0, np.eye(3)), left, LAYOUT, 0.008) == pytest.approx([-0.5])


def test_a_chain_with_a_hole_ends_there() -> None:
    pose = (0.5, 0.1, 1.0)
    one, _, three = chain(pose, [0.1, 0.1, 0.1])
    links = [[one, three], [], [one, three]]
    assert tail_angles(HeadPose(*pose, np.eye(3)), links, LAYOUT, 0.008) == pytest.approx([0.1])


@pytest.mark.parametrize("share", [1.0 - 0.009 / 0.0233, 1.0 + 0.009 / 0.0233])
def test_a_marker_at_the_wrong_distance_is_no_link(share: float) -> None:
    stray = [[spot(-0.075 - share * 0.0233, 0.0)]]
    head = HeadPose(0.0, 0.0, 0.0, np.eye(3))
    assert tail_angles(head, stray, LAYOUT, 0.008) == ()
    assert tail_angles(head, stray, LAYOUT, 0.010) == pytest.approx([0.0])


def test_swapped_head_markers_are_seen_by_the_tail() -> None:
    pose = (0.5, 0.1, 1.0)
    tail = chain(pose, [0.2, 0.1, 0.1])
    assert tail_sides(HeadPose(*pose, np.eye(3)), tail, LAYOUT, 0.08) == (3, 0)
    assert tail_sides(HeadPose(0.5, 0.1, 1.0 - pi, np.eye(3)), tail, LAYOUT, 0.08) == (0, 3)
    assert tail_sides(HeadPose(*pose, np.eye(3)), [], LAYOUT, 0.08) == (0, 0)
