# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors compared with each other: units, signs and axes that do not fit are errors, as no fit can mend them.

Every check compares two records of the same motion. It speaks only where the data are sure; a finding names the sensor, what
was found, by which evidence, and what to change. Not seen, as no record shows it: gyro x and y of a fish that only yaws, and
the accelerometer's directions without a camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

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
from fish_bag.trial import FROZEN, JUMP, Camera, Trial
from fish_bag.yaw_checks import check_yaw

TURNS = {"gyro_axes", "camera_heading"}  # findings after which accelerations cannot be compared
STILL = 1.0  # rad/s, change of the commanded rotor speed from which the robot moves
JUMPY = 0.3  # share of poses flagged as jumps from which the camera speaks in another unit
FROZEN_S = 1.0  # that a gyro gives one value while the rotor moves
FROZEN_SAMPLES = 5  # of one value, at least
HELD = 5.0  # times as long as a sensor usually holds a value, which one slower than its driver does
# rad/s to both sides of a rotor that moves; strokes have tens and hundreds, an encoder's noise less
MOVES = 10.0


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


def flag_frozen(trial: Trial) -> tuple[Trial, list[Problem]]:
    """The trial with gyro samples flagged that stay at one value while the rotor moves, and what is said of them.

    Without an encoder nobody knows whether the rotor follows: there the accelerometer must stay at one value, too. A gyro z that
    is the same throughout, as one on another axis, is left to `check_sensors`.
    """
    commands, encoder, imu = trial.clean().commands, trial.clean().encoder, trial.imu
    if commands is None or imu is None:
        return trial, []
    good = np.flatnonzero(imu.flags == 0)
    good = good[np.argsort(imu.t[good], kind="stable")]
    t, yaw = imu.t[good], imu.gyro[good, 2]
    begins = np.concatenate([[0], np.flatnonzero(np.diff(yaw)) + 1])
    if len(begins) == 1:
        return trial, []
    ends = np.concatenate([begins[1:], [len(yaw)]]) - 1
    held = float(np.median(np.diff(t[begins])))
    stays = (t[ends] - t[begins] > max(FROZEN_S, HELD * held)) & (
        ends - begins >= FROZEN_SAMPLES - 1
    )
    frozen = np.zeros(len(imu), bool)
    spans = []
    for begin, end in zip(begins[stays], ends[stays], strict=True):
        since = _moves_since(commands.t, commands.rotor_speed, t[begin], t[end])
        if (
            encoder is None
        ):  # a robot that is not armed does not follow; at rest an accelerometer is noisy
            turns = not np.ptp(imu.accel[good[begin : end + 1]], axis=0).any()
        else:
            turns = np.isfinite(_moves_since(encoder.t, encoder.speed, t[begin], t[end]))
        first = begin + int(np.searchsorted(t[begin : end + 1], since))
        if turns and first <= end:
            frozen[good[first : end + 1]] = True
            spans.append((float(yaw[begin]), float(t[first]), float(t[end])))
    if not spans:
        return trial, []
    value, start, end = max(spans, key=lambda span: span[2] - span[1])
    text = (
        f"{frozen.sum()} of {len(imu)} samples of gyro z stay at one value while the rotor moves, such as "
        f"{value:.3g} rad/s from {start:.2f} to {end:.2f} s; is the sensor alive?"
    )
    flags = imu.flags | np.where(frozen, FROZEN, 0).astype(imu.flags.dtype)
    said = Problem("warning", "frozen", imu.topic, text, int(frozen.sum()), start)
    return replace(trial, imu=replace(imu, flags=flags)), [said]


def _moves_since(t: np.ndarray, speed: np.ndarray, begin: float, end: float) -> float:
    """When a rotor with speeds (N,) at times t (N,) begins to move between two times; infinite: it does not for long enough.

    It moves from when it leaves its first speed until it takes its last one.
    """
    inside = np.flatnonzero((t >= begin) & (t <= end))
    if not len(inside):
        return np.inf
    at, turned = t[inside], speed[inside]
    left = at[np.abs(turned - turned[0]) > MOVES]
    came = at[np.abs(turned - turned[-1]) > MOVES]
    return float(left[0]) if len(left) and len(came) and came[-1] - left[0] > FROZEN_S else np.inf


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
        angle = encoder.angle[np.isfinite(encoder.angle)]
        held += [(encoder.topic, "rotor angle", angle)] if len(angle) >= FEWEST else []
    if camera is not None and len(camera) >= FEWEST:
        moved = np.ptp(camera.pose[:, :2], axis=0).any()
        held.append((camera.topic, *(("heading", camera.psi) if moved else ("pose", camera.pose))))
    for topic, name, values in held:
        if not np.ptp(values, axis=0).any():
            value = np.array2string(np.atleast_1d(values[0]), precision=3)
            text = f"{name} is {value} throughout while the rotor is commanded to move; is the sensor alive?"
            yield Problem("warning", "stuck", topic, text)
