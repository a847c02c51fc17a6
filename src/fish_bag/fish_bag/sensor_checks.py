# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors compared with each other: units, signs and axes that do not fit are errors, as no fit can mend them.

Every check compares two records of the same motion. It speaks only where the data are sure; a finding names the sensor, what
was found, by which evidence, and what to change. Not seen, as no record shows it: gyro x and y of a fish that only yaws, and
the accelerometer's directions without a camera.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fish_bag.accelerometer_checks import check_directions, check_gravity, felt_acceleration
from fish_bag.actuator_checks import (
    check_commanded_speed,
    check_encoder,
    check_rotor,
    check_rudder,
    check_tail,
)
from fish_bag.camera_checks import check_course, check_size, check_unit
from fish_bag.problem import Problem
from fish_bag.record_comparison import FEWEST
from fish_bag.trial import JUMP, Camera, Trial
from fish_bag.yaw_checks import check_yaw

TURNS = {"gyro_axes", "camera_heading"}  # findings after which accelerations cannot be compared
STILL = 1.0  # rad/s, change of the commanded rotor speed from which the robot moves
JUMPY = 0.3  # share of poses flagged as jumps from which the camera speaks in another unit


def check_sensors(trial: Trial) -> Iterator[Problem]:
    """Problems between the sensors of one trial, on its unflagged samples."""
    clean = trial.clean()
    yield from _stuck(clean)
    commands, encoder, imu = clean.commands, clean.encoder, clean.imu
    camera = _poses(trial.camera)
    rotor: list[Problem] = []
    if commands is not None:
        rotor = [*check_commanded_speed(commands), *check_rotor(commands, encoder)]
        yield from rotor
        yield from check_rudder(commands)
        if clean.tail is not None:
            yield from check_tail(commands, clean.tail)
    if encoder is not None:
        yield from check_encoder(encoder)
    gravity = [] if imu is None else list(check_gravity(imu))
    yield from gravity
    axes: list[Problem] = []
    size: list[Problem] = []
    felt = None
    if camera is not None:
        size = list(check_size(camera))
        axes = list(check_course(camera))
        if imu is not None and not gravity and not size and not axes:
            felt = felt_acceleration(imu, camera)
    yield from size + axes
    yaw = list(check_yaw(clean, None if size else camera, felt))
    said = {problem.kind for problem in rotor}
    yield from (problem for problem in yaw if problem.kind not in said)
    wrong = {problem.kind for problem in yaw}
    if imu is not None and camera is not None and felt is not None and not wrong & TURNS:
        yield from check_unit(camera, felt)
        if "camera_axes" not in wrong:
            yield from check_directions(imu, felt)


def _poses(camera: Camera | None) -> Camera | None:
    """The unflagged poses in order of time; also those flagged as jumps where most are, as in another unit of length."""
    if camera is None:
        return None
    jumps = camera.flags == JUMP
    kept = jumps | (camera.flags == 0) if np.mean(jumps) > JUMPY else camera.flags == 0
    found = camera.take(np.flatnonzero(kept))
    found = found.take(np.argsort(found.t, kind="stable"))
    return found if len(found) > 1 else None


def _stuck(trial: Trial) -> Iterator[Problem]:
    """Sensors that give one value throughout, which no sensor of a moving robot does."""
    imu, camera, encoder = trial.imu, trial.camera, trial.encoder
    moves = trial.commands is not None and np.ptp(trial.commands.rotor_speed) > STILL
    if not moves:
        return
    held = []
    if imu is not None and len(imu) >= FEWEST:
        held += [(imu.topic, "gyro", imu.gyro), (imu.topic, "accelerometer", imu.accel)]
    if encoder is not None and len(encoder) >= FEWEST:
        held += [(encoder.topic, "rotor speed", encoder.speed)]
        held += [(encoder.topic, "rotor angle", encoder.angle)]
    if camera is not None and len(camera) >= FEWEST:
        moved = np.ptp(camera.pose[:, :2], axis=0).any()
        held.append((camera.topic, *(("heading", camera.psi) if moved else ("pose", camera.pose))))
    for topic, name, values in held:
        if not np.ptp(values, axis=0).any():
            value = np.array2string(np.atleast_1d(values[0]), precision=3)
            text = f"{name} is {value} throughout while the rotor is commanded to move; is the sensor alive?"
            yield Problem("warning", "stuck", topic, text)
