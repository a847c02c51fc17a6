# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages, parameters and watchdogs of the nodes."""

import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry

from fish_control.excitation import LAST_ROW
from fish_control.gains_file import read_gains_file
from fish_control.line_of_sight import Motion
from fish_control.node_configs import (
    ControllerConfig,
    ExciterConfig,
    FusionNodeConfig,
    PlannerConfig,
)
from fish_control.nodes.messages import (
    estimate_signs,
    motion_of,
    planar_covariance,
    seconds,
    to_quaternion,
    to_stamp,
    yaw_of,
)
from fish_control.watchdog import (
    EstimateHealth,
    Health,
    Watchdog,
    estimate_fault,
    is_plausible,
    loss,
    pose_loss,
)

# rows of a covariance (x, y, z, rotation about x, y, z): geometry_msgs/PoseWithCovariance
X, Y, YAW = 0, 1, 5


@pytest.mark.parametrize("yaw", [-3.1, -0.4, 0.0, 1.6, 3.1])
def test_a_heading_is_a_rotation_about_z(yaw):
    q = to_quaternion(yaw)
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    assert yaw_of(q) == pytest.approx(yaw)
    assert yaw_of(Quaternion(z=-q.z, w=-q.w)) == pytest.approx(yaw)  # the same rotation


def test_the_heading_of_a_body_that_rolls_and_pitches_is_where_its_nose_points_from_above():
    """Rotations about z by 0.7, then about y by 0.2, then about x by -0.3 rad, multiplied out as matrices."""
    roll, pitch, yaw = -0.3, 0.2, 0.7
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    q = Quaternion(
        w=cr * cp * cy + sr * sp * sy,
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
    )
    assert yaw_of(q) == pytest.approx(0.7)


@pytest.mark.parametrize("w", [0.0, 0.5, 2.0, math.nan])
def test_a_quaternion_that_is_none_has_no_heading(w):
    assert math.isnan(yaw_of(Quaternion(w=w)))


@pytest.mark.parametrize("time", [0.0, 12.25, 1.76e9 + 0.123456, 3.0 - 1e-10])
def test_stamps_keep_the_time(time):
    stamp = to_stamp(time)
    assert 0 <= stamp.nanosec < 1_000_000_000
    assert seconds(stamp) == pytest.approx(time, rel=1e-15, abs=1.1e-9)


def test_the_planar_part_of_a_covariance_is_of_x_y_and_yaw():
    planar = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]])
    full = np.full((6, 6), 99.0)
    full[np.ix_([X, Y, YAW], [X, Y, YAW])] = planar
    np.testing.assert_array_equal(planar_covariance(full.ravel()), planar)


def odometry():
    """At (1, 2) m on heading 0.5 rad with 0.3 m/s ahead, 0.1 m/s to the left and 0.7 rad/s, stamped 10.25 s."""
    message = Odometry()
    message.header.stamp = to_stamp(10.25)
    message.pose.pose.position.x, message.pose.pose.position.y = 1.0, 2.0
    message.pose.pose.orientation = to_quaternion(0.5)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = 0.3, 0.1, 0.7
    return message


def test_a_motion_is_pose_in_the_pool_and_velocity_of_the_body():
    assert motion_of(odometry()) == pytest.approx((1.0, 2.0, 0.5, 0.3, 0.1, 0.7))


@pytest.mark.parametrize("place", [X, Y, YAW])
def test_signs_of_an_estimate_hold_the_worst_variance_of_pose_and_of_twist(place):
    message = odometry()
    message.pose.covariance[7 * place], message.twist.covariance[7 * place] = 0.5, 0.25
    signs = estimate_signs(message, now=10.5)
    assert (signs.age, signs.plausible) == (pytest.approx(0.25), True)
    assert (signs.pose_variance, signs.twist_variance) == (0.5, 0.25)


@pytest.mark.parametrize("place", [X, Y, YAW])
def test_a_variance_below_zero_says_that_nobody_measured_it(place):
    message = odometry()
    message.pose.covariance[7 * place] = message.twist.covariance[7 * place] = -1.0
    signs = estimate_signs(message, now=10.5)
    assert "camera lost" in estimate_fault(signs, timeout=1.0, largest_variance=1.0)
    message.pose.covariance[7 * place] = 0.01
    signs = estimate_signs(message, now=10.5)
    assert "IMU lost" in estimate_fault(signs, timeout=1.0, largest_variance=1.0)


@pytest.mark.parametrize("spoil", ["position", "velocity", "orientation"])
def test_an_estimate_with_a_value_that_is_no_number_is_not_finite(spoil):
    message = odometry()
    if spoil == "position":
        message.pose.pose.position.y = math.nan
    elif spoil == "velocity":
        message.twist.twist.angular.z = math.inf
    else:
        message.pose.pose.orientation = Quaternion(w=0.0)
    assert not estimate_signs(message, now=10.5).plausible


@pytest.mark.parametrize("field", Motion._fields)
@pytest.mark.parametrize("value", [math.nan, math.inf, 1e200, -2e3])
def test_a_motion_with_a_value_that_no_fish_has_is_not_plausible(field, value):
    motion = Motion(2.0, -1.0, math.pi, 0.5, -0.1, -3.0)
    assert is_plausible(motion)
    assert not is_plausible(motion._replace(**{field: value}))


CONFIG = Path(__file__).parents[1] / "config"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("fusion", FusionNodeConfig),
        ("planner", PlannerConfig),
        ("controller", ControllerConfig),
        ("exciter", ExciterConfig),
    ],
)
def test_yaml_holds_the_dataclass(name, kind):
    parameters = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())["/**"]["ros__parameters"]
    defaults = asdict(kind()).items()
    assert parameters == {k: list(v) if isinstance(v, tuple) else v for k, v in defaults}
    assert list(parameters) == list(asdict(kind()))


def test_the_exciters_comment_says_how_long_the_last_row_lasts():
    (end,) = [
        line for line in (CONFIG / "exciter.yaml").read_text().splitlines() if " end:" in line
    ]
    assert end.endswith(f"its end, {LAST_ROW:g} s after its last row begins")


def test_shipped_weights_fit_the_shipped_controller():
    config = ControllerConfig()
    policy = read_gains_file(CONFIG / "gains.safetensors")
    assert policy.contract.differences(1.0 / config.rate_hz, config.lookahead) == []


@pytest.mark.parametrize(
    ("kind", "field", "value", "expected"),
    [
        (PlannerConfig, "speed", 0.6, "0.05 to 0.5 m/s"),
        (PlannerConfig, "speed", float("nan"), "0.05 to 0.5 m/s"),
        (PlannerConfig, "end", "bounce", "known: , stop, loop"),
        (PlannerConfig, "start", "middle", "known: beginning, nearest"),
        (PlannerConfig, "lookahead", 0.0, "lookahead"),
        (ControllerConfig, "command_rate_hz", 120.0, "a multiple of rate_hz"),
        (ControllerConfig, "odometry_timeout", 0.0, "0.02 to 5"),
        (ExciterConfig, "begin", -1.0, "0 to 3600 s"),
        (ExciterConfig, "margin", float("nan"), "0 to 1 m"),
    ],
)
def test_a_value_out_of_range_is_named(kind, field, value, expected):
    with pytest.raises(ValueError) as refusal:
        kind(**{field: value})
    assert field in str(refusal.value)
    assert repr(value) in str(refusal.value)
    assert expected in str(refusal.value)


SURE = EstimateHealth(0.01, True, 1e-5, 1e-4)
GOOD = Health(SURE, 0.02, 0.02, 0.02)


def but(**changes):
    return replace(GOOD, estimate=replace(SURE, **changes))


FAULTS = {
    "odometry is stale": but(age=0.3),
    "odometry is not plausible": but(plausible=False),
    "camera lost": but(pose_variance=1e4),
    "IMU lost": but(twist_variance=1e4),
    "target is stale": replace(GOOD, target_age=0.5),
    "control/twist is stale": replace(GOOD, twist_age=0.5),
    "tracking/error is stale": replace(GOOD, error_age=0.5),
    "control/twist is from the future": replace(GOOD, twist_age=-0.3),
    "odometry is from the future: stamped 5.00 s ahead": but(age=-5.0),
    "target is from the future: stamped 0.30 s ahead": replace(GOOD, target_age=-0.3),
}


def swimming(**parameters):
    dog = Watchdog(ControllerConfig(**parameters))
    assert dog.check(0.0, GOOD)
    return dog


def test_it_waits_for_odometry_and_target_without_calling_it_a_stop():
    dog = Watchdog(ControllerConfig())
    assert not dog.check(0.0, Health(None, None, None, None))
    assert dog.reason == "waiting for odometry"
    assert dog.fault == ""
    for kind in ("target_age", "twist_age", "error_age"):
        assert not dog.check(0.1, replace(GOOD, **{kind: None}))
    assert (dog.state, dog.stops) == ("waiting", 0)
    assert dog.check(0.2, GOOD)
    assert dog.state == "swimming"


@pytest.mark.parametrize("said", FAULTS)
def test_every_fault_stops_at_once_and_is_said(said):
    dog = swimming()
    assert not dog.check(0.01, FAULTS[said])
    assert dog.state == "stopped"
    assert dog.reason.startswith(said)
    assert dog.stops == 1
    assert dog.fault == dog.reason
    assert not dog.check(0.02, GOOD)  # all is well, and it waits a little
    assert dog.fault == ""


def test_a_disarmed_robot_is_waited_for_without_calling_it_a_stop():
    dog = swimming()
    assert not dog.check(0.01, replace(GOOD, disarmed="coil at 90 deg C"))
    assert (dog.state, dog.stops) == ("waiting", 0)
    assert dog.reason == "disarmed: coil at 90 deg C"
    assert dog.check(0.02, GOOD)


def test_clocks_that_differ_by_little_are_no_fault():
    assert swimming().check(0.01, replace(but(age=-0.05), target_age=-0.05))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_variance_that_is_no_number_is_a_fault(value):
    assert not swimming().check(0.01, but(pose_variance=value))


@pytest.mark.parametrize("variance", [1.01, 1e4, math.nan])
def test_what_is_lost_is_lost_at_any_age(variance):
    no_pose, no_twist = (
        replace(SURE, age=99.0, **{k: variance}) for k in ("pose_variance", "twist_variance")
    )
    assert (
        pose_loss(no_pose, 1.0)
        == loss(no_pose, 1.0)
        == "camera lost: fusion does not vouch for the pose"
    )
    assert pose_loss(no_twist, 1.0) is None
    assert loss(no_twist, 1.0) == "IMU lost: fusion does not vouch for the velocity"
    assert loss(replace(SURE, age=99.0), 1.0) is None


@pytest.mark.parametrize("said", FAULTS)
def test_it_goes_on_after_the_delay(said):
    dog = swimming(resume_delay=0.5)
    dog.check(0.1, FAULTS[said])
    assert not dog.check(0.2, GOOD)
    assert not dog.check(0.6, GOOD)
    assert dog.check(0.71, GOOD)


def test_the_delay_starts_again_with_every_fault():
    dog = swimming(resume_delay=0.5)
    dog.check(0.1, FAULTS["camera lost"])
    dog.check(0.2, GOOD)
    dog.check(0.6, FAULTS["camera lost"])
    assert not dog.check(0.8, GOOD)
    assert dog.stops == 1
