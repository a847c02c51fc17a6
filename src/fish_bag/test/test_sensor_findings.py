# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Units, signs and axes of sensors that share one motion: found where the data tell, and nothing said where they do not."""

from dataclasses import replace

import numpy as np
import pytest
from stroke_swim import Course, stroke_swim

from fish_bag.camera_checks import find_jumps
from fish_bag.checks import check_rotor_sign
from fish_bag.sensor_checks import check_sensors
from fish_bag.trial import JUMP

QUARTER = np.array(
    [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
)  # body axes in those of an IMU turned to the left


def imu(trial, gyro=lambda g: g, accel=lambda a: a):
    changed = replace(trial.imu, gyro=gyro(trial.imu.gyro), accel=accel(trial.imu.accel))
    return replace(trial, imu=changed)


def camera(trial, pose):
    seen = pose(trial.camera.pose)
    psi = np.mod(seen[:, 2] + np.pi, 2 * np.pi) - np.pi
    jumps = find_jumps(trial.camera.t, seen[:, 0], seen[:, 1], psi)
    flags = np.where(jumps, JUMP, 0).astype(np.uint8)
    changed = replace(trial.camera, x=seen[:, 0], y=seen[:, 1], psi=psi, flags=flags)
    return replace(trial, camera=changed)


def commands(trial, rotor=1.0, rudder=lambda a: a):
    old = trial.commands
    changed = replace(old, rotor_speed=rotor * old.rotor_speed, rudder=rudder(old.rudder))
    return replace(trial, commands=changed)


def rotor(trial, factor):
    old = trial.encoder
    changed = replace(old, speed=factor * old.speed, angle=factor * old.angle)
    return replace(commands(trial, rotor=factor), encoder=changed)


def findings(trial):
    found = [*check_sensors(trial), *check_rotor_sign(trial.commands, trial.encoder)]
    return {(problem.severity, problem.kind): problem.text for problem in found}


FAULTS = {
    "gyro in deg/s": (lambda s: imu(s, gyro=np.degrees), "error", "gyro_unit", "57."),
    "gyro z down": (lambda s: imu(s, gyro=lambda g: -g), "error", "gyro_sign", "change the sign"),
    "gyro z and y swapped": (
        lambda s: imu(s, gyro=lambda g: g[:, [0, 2, 1]]),
        "error",
        "gyro_axes",
        "its axis y",
    ),
    "IMU turned by 90 deg": (
        lambda s: imu(s, lambda g: g @ QUARTER.T, lambda a: a @ QUARTER.T),
        "error",
        "accel_axes",
        "turned by 90 deg",
    ),
    "IMU turned by -90 deg": (
        lambda s: imu(s, lambda g: g @ QUARTER, lambda a: a @ QUARTER),
        "error",
        "accel_axes",
        "turned by -90 deg",
    ),
    "IMU turned by 180 deg": (
        lambda s: imu(s, lambda g: g * [-1, -1, 1], lambda a: a * [-1, -1, 1]),
        "error",
        "accel_axes",
        "turned by 180 deg",
    ),
    "accelerometer x and y swapped": (
        lambda s: imu(s, accel=lambda a: a[:, [1, 0, 2]]),
        "error",
        "accel_axes",
        "x and y swapped",
    ),
    "accelerometer x mirrored": (
        lambda s: imu(s, accel=lambda a: a * [-1, 1, 1]),
        "error",
        "accel_axes",
        "the other sign of x",
    ),
    "accelerometer y mirrored": (
        lambda s: imu(s, accel=lambda a: a * [1, -1, 1]),
        "error",
        "accel_axes",
        "the other sign of y",
    ),
    "accelerometer z down": (
        lambda s: imu(s, accel=lambda a: a * [1, -1, -1]),
        "error",
        "accel_axes",
        "along -z",
    ),
    "accelerometer in g": (
        lambda s: imu(s, accel=lambda a: a / 9.81),
        "error",
        "accel_unit",
        "(g?)",
    ),
    "accelerometer in mg": (
        lambda s: imu(s, accel=lambda a: a / 9.81e-3),
        "error",
        "accel_unit",
        "thousandths of g",
    ),
    "accelerometer without gravity": (
        lambda s: imu(s, accel=lambda a: a - [0, 0, 9.81]),
        "error",
        "accel_unit",
        "gravity taken out",
    ),
    "camera in feet": (
        lambda s: camera(s, lambda p: p * [3.281, 3.281, 1]),
        "error",
        "camera_unit",
        "feet",
    ),
    "camera in inches": (
        lambda s: camera(s, lambda p: p * [39.37, 39.37, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera in cm": (
        lambda s: camera(s, lambda p: p * [100, 100, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera in mm": (
        lambda s: camera(s, lambda p: p * [1000, 1000, 1]),
        "error",
        "camera_unit",
        "metres",
    ),
    "camera y mirrored, heading not": (
        lambda s: camera(s, lambda p: p * [1, -1, 1]),
        "error",
        "camera_axes",
        "mirrored or swapped",
    ),
    "camera x and y swapped, heading not": (
        lambda s: camera(s, lambda p: p[:, [1, 0, 2]]),
        "error",
        "camera_axes",
        "mirrored or swapped",
    ),
    "left-handed camera": (
        lambda s: camera(s, lambda p: p * [1, -1, -1]),
        "error",
        "camera_axes",
        "left-handed",
    ),
    "heading in deg": (
        lambda s: camera(s, lambda p: p * [1, 1, np.degrees(1)]),
        "error",
        "camera_heading",
        "57.3 times",
    ),
    "marker turned by 180 deg": (
        lambda s: camera(s, lambda p: p + [0, 0, np.pi]),
        "error",
        "camera_heading",
        "180 deg",
    ),
    "rudder in deg": (
        lambda s: commands(s, rudder=np.degrees),
        "error",
        "rudder_unit",
        "deg?",
    ),
    "rudder in servo pulses": (
        lambda s: commands(s, rudder=lambda a: 1500 + 500 * a),
        "error",
        "rudder_unit",
        "servo pulses",
    ),
    "rudder from -1 to 1": (
        lambda s: commands(s, rudder=lambda a: np.clip(5 * a, -1, 1)),
        "warning",
        "rudder_unit",
        "-1 to 1",
    ),
    "rudder to the other side": (
        lambda s: commands(s, rudder=lambda a: -a),
        "error",
        "rudder_sign",
        "against the rudder",
    ),
    "rotor in deg/s": (lambda s: rotor(s, 57.3), "error", "rotor_unit", "deg/s"),
    "rotor in rpm": (lambda s: rotor(s, 9.549), "warning", "rotor_unit", "rpm"),
    "encoder's angle in deg": (
        lambda s: replace(s, encoder=replace(s.encoder, angle=np.degrees(s.encoder.angle))),
        "error",
        "encoder_unit",
        "change of the rotor's angle is 57",
    ),
    "rotor turned round": (lambda s: rotor(s, -1.0), "error", "rotor_sign", "hull turns with"),
    "command in rpm": (lambda s: commands(s, rotor=9.549), "error", "rotor_unit", "rpm"),
    "tail in deg": (
        lambda s: replace(s, tail=replace(s.tail, angle=np.degrees(s.tail.angle))),
        "error",
        "tail_unit",
        "deg",
    ),
    "tail to the other side": (
        lambda s: replace(s, tail=replace(s.tail, angle=-s.tail.angle)),
        "error",
        "tail_sign",
        "wrong sign",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_and_named(name):
    fault, severity, kind, words = FAULTS[name]
    assert words in findings(fault(stroke_swim())).get((severity, kind), "")


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "course",
    [
        Course(),
        Course(duration=6.0),
        Course(turns=0.0, speeds=0.0),
        Course(turns=0.0),
        Course(turns=3.0, speeds=0.0),
        Course(rotor=15.0),
        Course(rotor=0.0),
        Course(duration=90.0),
    ],
    ids=str,
)
def test_a_faultless_swim_has_no_finding(course, seed):
    assert findings(stroke_swim(course, seed)) == {}


def test_a_left_handed_camera_is_one_finding():
    found = findings(camera(stroke_swim(), lambda p: p * [1, -1, -1]))
    assert set(found) == {("error", "camera_axes")}


def test_a_heading_in_degrees_blames_nothing_else():
    found = findings(camera(stroke_swim(), lambda p: p * [1, 1, np.degrees(1)]))
    assert set(found) == {("error", "camera_heading")}


@pytest.mark.parametrize("seed", range(3))
def test_a_fish_that_glides_straight_ahead_tells_no_directions(seed):
    """No turns, one speed, no strokes: the accelerometer may lie in any direction."""
    swim = stroke_swim(Course(turns=0.0, speeds=0.0, rotor=0.0), seed)
    for direction in (np.diag([-1, -1, 1]), QUARTER):
        assert findings(imu(swim, accel=lambda a, d=direction: a @ d)) == {}


def test_a_straight_swim_leaves_two_directions():
    """Strokes push the head sideways only, so that y is known to be wrong, and x may be either way."""
    swim = stroke_swim(Course(turns=0.0, speeds=0.0))
    text = findings(imu(swim, accel=lambda a: a * [-1, -1, 1]))["error", "accel_axes"]
    assert "turned by 180 deg" in text
    assert "the other sign of y" in text


def test_a_sensor_of_its_own_tells_nothing():
    """Without a camera no record shows the accelerometer's direction, without an IMU none the camera's feet."""
    swim = stroke_swim()
    alone = replace(imu(swim, accel=lambda a: a * [-1, -1, 1]), camera=None)
    assert findings(alone) == {}
    feet = replace(camera(swim, lambda p: p * [3.281, 3.281, 1]), imu=None)
    assert findings(feet) == {}


def test_roll_that_mixes_gravity_into_y_is_no_wrong_sign():
    """A hull that leans into its turns feels gravity sideways, several times the acceleration of the turn."""
    swim = stroke_swim(Course(rotor=0.0))
    roll = 0.1 * np.sin(0.5 * swim.imu.t)
    rate = np.gradient(roll, swim.imu.t)[:, None] * [1, 0, 0]
    leaning = imu(swim, lambda g: g + rate, lambda a: a - 9.81 * roll[:, None] * [0, 1, 0])
    assert findings(leaning) == {}
