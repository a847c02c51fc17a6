# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors compared with each other: units, signs and axes that do not fit are errors, as no fit can mend them.

Every check compares two records of the same motion by a straight line through their common variation. It speaks only where
both vary enough and follow each other; a slope far from 1 is another unit, a negative one another direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from fish_bag.problem import Problem
from fish_bag.trial import JUMP, Camera, Commands, Encoder, Imu, Trial

STILL = 1.0  # rad/s, change of the commanded rotor speed from which the robot moves
GRAVITY = 9.81  # m/s^2
SLOPES = (0.6, 1.6)  # of records in the same unit; a sensor of the real world is a few per cent off
FOLLOWS = 0.9  # correlation from which one record follows the other
STRAYS = 0.5  # correlation below which it does not
FEWEST = 50  # samples
TURN_RAD = 0.05  # standard deviation of the heading from which it can be compared
WAY_M, STEP_M = 0.3, 0.03  # m; way of the camera's pose that shows a direction, and steps of it
STRAY_TURN_RAD = 0.3  # from which a gyro must show it
LARGEST_RUDDER_RAD = 1.6  # no servo turns its rudder farther
LARGEST_ROTOR_RAD_S = 1000.0
RUDDER_TURN_RAD = 0.2  # standard deviation of the heading's change in a second
RUDDER_DELAYS_S = (0.0, 0.15, 0.3)
RUDDER_FOLLOWS = 0.6  # correlation; a controller acts against disturbances, which lowers it
LARGEST_WAY_M, LARGEST_SPEED_M_S = 50.0, 5.0  # of a fish in a pool
UNITS = {57.3: "deg", 9.549: "rpm", 0.1592: "revolutions", 1000.0: "thousandths"}


def check_sensors(trial: Trial) -> Iterator[Problem]:
    """Problems between the sensors of one trial, on its unflagged samples."""
    clean = trial.clean()
    yield from _stuck(clean)
    if clean.imu is not None:
        yield from _accelerometer(clean.imu)
        if clean.camera is not None:
            yield from _gyro(clean.imu, clean.camera)
    if trial.camera is not None:  # in another unit every pose is flagged as a jump
        usable = (trial.camera.flags | JUMP) == JUMP
        yield from _camera(trial.camera.take(np.flatnonzero(usable)))
    if clean.commands is not None:
        yield from _commands(clean.commands)
        if clean.camera is not None:
            yield from _rudder(clean.commands, clean.camera)
        if clean.encoder is not None:
            yield from _rotor(clean.commands, clean.encoder)
    if clean.encoder is not None:
        yield from _encoder(clean.encoder)


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
        held.append((camera.topic, "pose", camera.pose))
    for topic, name, values in held:
        if not np.ptp(values, axis=0).any():
            value = np.array2string(np.atleast_1d(values[0]), precision=3)
            text = f"{name} is {value} throughout while the rotor is commanded to move; is the sensor alive?"
            yield Problem("warning", "stuck", topic, text)


def _gyro(imu: Imu, camera: Camera) -> Iterator[Problem]:
    """The integrated angular velocity against the camera's heading."""
    inside = (camera.t >= imu.t[0]) & (camera.t <= imu.t[-1])
    t, psi = camera.t[inside], np.unwrap(camera.psi[inside])
    if len(t) < FEWEST or len(imu) < FEWEST:
        return
    psi = _without_trend(t, psi)
    if np.std(psi) < TURN_RAD:
        return
    angles = [
        _without_trend(t, np.interp(t, imu.t, _integral(imu.t, imu.gyro[:, axis])))
        for axis in range(3)
    ]
    followed = [_correlation(psi, angle) for angle in angles]
    best = int(np.argmax(np.abs(followed)))
    if abs(followed[2]) < STRAYS and abs(followed[best]) > FOLLOWS:
        text = f"its axis {'xyz'[best]} follows the camera's heading, expected z: axes are swapped"
        yield Problem("error", "gyro_axes", imu.topic, text)
        return
    if abs(followed[2]) < STRAYS and np.std(psi) > STRAY_TURN_RAD:
        text = f"gyro z does not follow the camera's heading (correlation {followed[2]:.2f})"
        yield Problem("warning", "gyro", imu.topic, text)
    elif followed[2] < -FOLLOWS:
        text = "gyro z turns against the camera's heading; expected the same sign: one of them is mirrored"
        yield Problem("error", "gyro_sign", imu.topic, text)
    elif followed[2] > FOLLOWS:
        yield from _unit(
            "gyro_unit",
            imu.topic,
            "gyro z, integrated, is {} times the camera's heading",
            "rad/s",
            np.std(angles[2]) / np.std(psi),
        )


def _accelerometer(imu: Imu) -> Iterator[Problem]:
    """Specific force at rest is gravity, upwards."""
    force = np.median(imu.accel, axis=0)
    size = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    if not np.isfinite(size) or len(imu) < FEWEST:
        return
    if not 0.7 * GRAVITY < size < 1.4 * GRAVITY:
        guess = "g" if 0.7 < size < 1.4 else "gravity taken out" if size < 0.3 * GRAVITY else ""
        held = f"specific force is {size:.3g} throughout{f' ({guess}?)' if guess else ''}"
        text = f"{held}; expected {GRAVITY} m/s^2, gravity included"
        yield Problem("error", "accel_unit", imu.topic, text)
        return
    if force[2] < 0.7 * size:
        axis = int(np.argmax(np.abs(force)))
        up = f"{'-' if force[axis] < 0 else '+'}{'xyz'[axis]}"
        text = f"specific force points along {up}, expected +z: axes are swapped or mirrored"
        yield Problem("error", "accel_axes", imu.topic, text)


def _camera(camera: Camera) -> Iterator[Problem]:
    """Heading against the direction of motion, and the pool's size."""
    if len(camera) < 2:
        return
    xy = np.column_stack([camera.x, camera.y])
    way = float(np.linalg.norm(np.ptp(xy, axis=0)))
    speed = _median_speed(camera)
    if way > LARGEST_WAY_M or speed > LARGEST_SPEED_M_S:
        text = (
            f"poses cover {way:.3g} m at {speed:.3g} m/s; expected metres in a pool: another unit?"
        )
        yield Problem("error", "camera_unit", camera.topic, text)
        return
    camera = camera.take(np.flatnonzero(camera.flags == 0))
    course, heading = _courses(camera)
    if len(course) < 10:
        return
    apart, together = np.exp(1j * (course - heading)), np.exp(1j * (course + heading))
    turned = float(np.angle(apart.mean()))
    if abs(apart.mean()) > 0.8 and abs(turned) > np.pi / 4:
        text = f"the heading lies {np.degrees(turned):.0f} deg from the direction of motion; expected 0"
        yield Problem("error", "camera_heading", camera.topic, text)
    elif abs(together.mean()) > 0.8 and (abs(apart.mean()) < STRAYS or _against(course, heading)):
        text = "the heading turns against the direction of motion: x and y are mirrored or swapped"
        yield Problem("error", "camera_axes", camera.topic, text)


def _courses(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Direction of motion and heading on the way, one for every step of STEP_M [rad]."""
    xy = np.column_stack([camera.x, camera.y])
    picked = [0]
    for i in range(1, len(xy)):
        if np.linalg.norm(xy[i] - xy[picked[-1]]) >= STEP_M:
            picked.append(i)
    steps = np.diff(xy[picked], axis=0)
    if len(steps) < 2 or STEP_M * len(steps) < WAY_M:
        return np.zeros(0), np.zeros(0)
    heading = [np.angle(np.exp(1j * camera.psi[a : b + 1]).mean()) for a, b in pairwise(picked)]
    return np.arctan2(steps[:, 1], steps[:, 0]), np.array(heading)


def _against(course: np.ndarray, heading: np.ndarray) -> bool:
    """Whether the direction of motion turns against the heading, also where both turn only a little."""
    course, heading = np.unwrap(course), np.unwrap(heading)
    wide = np.std(heading) > TURN_RAD and np.std(course) > TURN_RAD
    return bool(wide and _correlation(course, heading) < -FOLLOWS)


def _median_speed(camera: Camera) -> float:
    steps = np.hypot(np.diff(camera.x), np.diff(camera.y))
    times = np.diff(camera.t)
    return float(np.median(steps[times > 0] / times[times > 0])) if (times > 0).any() else 0.0


def _commands(commands: Commands) -> Iterator[Problem]:
    """Values that no servo and no motor of such a robot reaches."""
    rudder = float(np.max(np.abs(commands.rudder), initial=0.0))
    if rudder > LARGEST_RUDDER_RAD:
        text = f"the rudder goes to {rudder:.3g} rad; expected at most {LARGEST_RUDDER_RAD} (deg?)"
        yield Problem("error", "rudder_unit", commands.topic, text)
    rotor = float(np.max(np.abs(commands.rotor_speed), initial=0.0))
    if rotor > LARGEST_ROTOR_RAD_S:
        text = f"the rotor is commanded to {rotor:.4g} rad/s; expected at most {LARGEST_ROTOR_RAD_S:g} (rpm?)"
        yield Problem("error", "rotor_unit", commands.topic, text)


def _rudder(commands: Commands, camera: Camera) -> Iterator[Problem]:
    """The fish turns to the side to which its rudder is set: means over a second, at the delay that fits best."""
    start, end = max(commands.t[0], camera.t[0]) + 1.0, min(commands.t[-1], camera.t[-1]) - 1.0
    if end - start < 3.0 or len(camera) < FEWEST:
        return
    t = np.arange(start, end, 0.05)
    psi = np.unwrap(camera.psi)
    turned = np.interp(t + 0.5, camera.t, psi) - np.interp(t - 0.5, camera.t, psi)
    rudder = _integral(commands.t, commands.rudder)
    means = [
        np.interp(t + 0.5 - delay, commands.t, rudder)
        - np.interp(t - 0.5 - delay, commands.t, rudder)
        for delay in RUDDER_DELAYS_S
    ]
    if np.std(turned) < RUDDER_TURN_RAD or min(np.std(mean) for mean in means) < TURN_RAD:
        return
    followed = max((_correlation(mean, turned) for mean in means), key=abs)
    if followed < -RUDDER_FOLLOWS:
        text = f"the fish turns against the rudder (correlation {followed:.2f}); expected a left turn for a positive angle"
        yield Problem("error", "rudder_sign", commands.topic, text)


def _rotor(commands: Commands, encoder: Encoder) -> Iterator[Problem]:
    """Measured against commanded rotor speed; the sign is checked by `checks.check_rotor_sign`."""
    if len(commands) < FEWEST or len(encoder) < FEWEST:
        return
    wanted = np.interp(encoder.t, commands.t, commands.rotor_speed)
    if _correlation(wanted, encoder.speed) > FOLLOWS:
        yield from _unit(
            "rotor_unit",
            encoder.topic,
            "the measured rotor speed is {} times the command",
            "rad/s",
            np.std(encoder.speed) / np.std(wanted),
        )


def _encoder(encoder: Encoder) -> Iterator[Problem]:
    """The encoder's speed against the change of its angle, which may be wrapped."""
    if len(encoder) < FEWEST or np.ptp(encoder.speed) == 0 or np.ptp(encoder.angle) == 0:
        return
    change = np.diff(encoder.angle)
    if np.ptp(encoder.angle) <= 2 * np.pi + 0.1:
        change = np.mod(change + np.pi, 2 * np.pi) - np.pi
    elif np.ptp(encoder.angle) <= 360.5 and np.abs(change).max() > 180:
        change = np.mod(change + 180.0, 360.0) - 180.0
    steps = np.diff(encoder.t)
    if not (steps > 0).all():
        return
    mean = 0.5 * (encoder.speed[1:] + encoder.speed[:-1])
    rate = change / steps
    followed = _correlation(rate, mean)
    if followed < -FOLLOWS:
        text = "the rotor's angle runs against its speed; expected the same sign"
        yield Problem("error", "encoder_sign", encoder.topic, text)
    elif followed > FOLLOWS:
        yield from _unit(
            "encoder_unit",
            encoder.topic,
            "the rotor's measured speed is {} times the change of its angle",
            "rad and rad/s",
            np.std(mean) / np.std(rate),
        )


def _unit(kind: str, topic: str, text: str, unit: str, slope: float) -> Iterator[Problem]:
    """An error where a slope lies far from 1, with the unit that it looks like."""
    if SLOPES[0] < slope < SLOPES[1]:
        return
    close = [
        name
        for factor, name in UNITS.items()
        if 0.8 < slope / factor < 1.25 or 0.8 < slope * factor < 1.25
    ]
    guess = f" ({close[0]}?)" if close else ""
    yield Problem("error", kind, topic, f"{text.format(f'{slope:.3g}')}{guess}; expected {unit}")


def _integral(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(N,) integral from the first sample on, trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])


def _without_trend(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values without their straight line: a gyro's bias makes one."""
    base = np.column_stack([np.ones(len(t)), t - t.mean()])
    return np.asarray(values - base @ np.linalg.lstsq(base, values, rcond=None)[0])


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Of two records, 0 where one does not vary."""
    return float(np.corrcoef(a, b)[0, 1]) if np.std(a) and np.std(b) else 0.0
