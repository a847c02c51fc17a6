# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When the fish may swim."""

import math
from dataclasses import replace

import pytest

from fish_control.node_configs import ControllerConfig
from fish_control.watchdog import EstimateHealth, Health, Watchdog, loss, pose_loss

SURE = EstimateHealth(0.01, True, 1e-5, 1e-4)
GOOD = Health(SURE, 0.02)


def but(**changes):
    return replace(GOOD, estimate=replace(SURE, **changes))


FAULTS = {
    "odometry is stale": but(age=0.3),
    "odometry is not finite": but(finite=False),
    "camera lost": but(pose_variance=1e4),
    "IMU lost": but(twist_variance=1e4),
    "target is stale": replace(GOOD, target_age=0.5),
    "odometry is from the future: stamped 5.00 s ahead": but(age=-5.0),
    "target is from the future: stamped 0.30 s ahead": replace(GOOD, target_age=-0.3),
}


def swimming(**parameters):
    dog = Watchdog(ControllerConfig(**parameters))
    assert dog.check(0.0, GOOD)
    return dog


def test_it_waits_for_odometry_and_target_without_calling_it_a_stop():
    dog = Watchdog(ControllerConfig())
    assert not dog.check(0.0, Health(None, None))
    assert dog.reason == "waiting for odometry"
    assert dog.fault == ""
    assert not dog.check(0.1, replace(GOOD, target_age=None))
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
