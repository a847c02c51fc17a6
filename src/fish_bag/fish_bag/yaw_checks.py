# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Four records of one turn: gyro z, the camera's heading, the rotor (which turns the hull against itself) and the rudder.

Two that disagree do not say which of them is wrong; a third does.
The rotor's response is the cross-spectrum of rotor speed and yaw rate, averaged over blocks with a Hann window (Welch 1967), at
the frequency of the strokes. Gain |r / phi_dot| is the rotor's inertia over that of hull and water, far below 1; the phase lies
near 180 deg.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fish_bag.accelerometer_checks import MIRRORED, RECORDED, SURE, FeltAcceleration
from fish_bag.actuator_checks import rudder_follows
from fish_bag.problem import Problem
from fish_bag.record_comparison import (
    FEWEST,
    FOLLOWS,
    GRID_S,
    STRAYS,
    Array,
    common_grid,
    correlation,
    integral,
    unit_problem,
    without_trend,
)
from fish_bag.trial import Camera, Commands, Imu, Trial

PAUSE = 0.5  # s between samples of the IMU, across which nobody knows how the fish turned
BLOCK_S = 2.0  # of records whose spectra are averaged
LEAST_SPEED = 3.0  # rad/s rms; the rotor strokes
TURN_RAD = 0.05  # standard deviation of the heading from which it can be compared
SAME_TURNS = 0.5  # mean of unit vectors with the angles between turns by camera and by gyro
STRAY_TURN_RAD = 0.3  # from which a gyro must show it
RUDDER_FOLLOWS = 0.6  # correlation; a controller acts against disturbances, which lowers it
ANSWERS = 0.8  # coherence of the yaw rate with the rotor
STROKES = 0.3  # share of the yaw rate's power at the frequency of the strokes
WITH_ROTOR_RAD = np.pi / 4  # phase of a hull that turns with the rotor; it lies near pi
LEAST_GAIN = (
    0.004  # (rad/s) / (rad/s); simulated fish have 0.027 to 0.054, a real one has 0.005 to 0.018
)
SMALL_GAIN = 0.01  # that makes one doubt where the rotor also swings far
LARGEST_SWING_RAD = 20.0  # of the rotor to either side; the motor of the paper swings by 12
LARGEST_GAIN = 0.5  # the hull is heavier than its rotor


@dataclass(frozen=True)
class RotorResponse:
    """At the frequency at which the rotor's speed varies most."""

    gain: float  # (rad/s) / (rad/s)
    phase: float  # rad in (-pi, pi]
    coherence: float  # 0 to 1
    swing: float  # rad, amplitude of the rotor's angle at this frequency
    share: float  # of the yaw rate's power that lies at this frequency, 0 to 1


def rotor_response(
    t_rotor: Array, rotor_speed: Array, t_rate: Array, rate: Array
) -> RotorResponse | None:
    """The response of a yaw rate (M,) at times (M,) to a rotor speed (N,) at times (N,); None: too short, or no strokes."""
    t, block = common_grid(t_rotor, t_rate), round(BLOCK_S / GRID_S)
    if len(t) < 2 * block:
        return None
    records = np.stack([np.interp(t, t_rotor, rotor_speed), np.interp(t, t_rate, rate)])
    if np.std(records[0]) < LEAST_SPEED:
        return None
    blocks = np.lib.stride_tricks.sliding_window_view(records, block, axis=1)[:, :: block // 2]
    blocks = (blocks - blocks.mean(axis=2, keepdims=True)) * np.hanning(block)
    rotor, hull = np.fft.rfft(blocks, axis=2)[:, :, 1:]
    power = (np.abs(rotor) ** 2).sum(axis=0)
    at = int(np.argmax(power))
    yaw = (np.abs(hull) ** 2).sum(axis=0)
    cross = (hull[:, at] * np.conj(rotor[:, at])).sum()
    coherence = float(abs(cross) ** 2 / (power[at] * yaw[at])) if yaw[at] else 0.0
    share = float(yaw[max(0, at - 1) : at + 2].sum() / yaw.sum()) if yaw.any() else 0.0
    frequency = (at + 1) / BLOCK_S
    swing = float(np.sqrt(2.0) * np.std(records[0]) / (2.0 * np.pi * frequency))
    return RotorResponse(
        float(abs(cross) / power[at]), float(np.angle(cross)), coherence, swing, share
    )


def check_yaw(
    trial: Trial, camera: Camera | None, felt: FeltAcceleration | None
) -> Iterator[Problem]:
    """Problems of a clean trial; `camera` are its poses, None where they are not usable."""
    commands, imu = trial.commands, trial.imu
    follows = (
        rudder_follows(commands, camera) if commands is not None and camera is not None else None
    )
    answer = _answer(trial)
    headings = None if imu is None or camera is None else _headings(imu, camera)
    if imu is not None and camera is not None and (found := list(_degrees(imu, camera))):
        yield from found
        return
    if imu is not None and camera is not None and headings is not None:
        psi, angles = headings
        found = list(_gyro(imu, psi, angles))
        against = correlation(psi, angles[2]) < -FOLLOWS
        if against:
            found = [_which_is_mirrored(imu, camera, answer, felt, follows)]
        yield from found
        if against and found[0].kind == "camera_axes":
            return
    if commands is not None:
        sure = headings is None or correlation(headings[0], headings[1][2]) > FOLLOWS
        if sure and imu is not None:
            yield from _rotor(commands, answer, alone=headings is None)
        if sure and follows is not None and follows < -RUDDER_FOLLOWS:
            text = (
                f"the fish turns against the rudder (correlation {follows:.2f}); expected a left turn for a "
                "positive angle: change the sign of the rudder"
            )
            yield Problem("error", "rudder_sign", commands.topic, text)


def _degrees(imu: Imu, camera: Camera) -> Iterator[Problem]:
    """A heading in degrees, of which the quaternion keeps what is left after whole turns: looked for between poses."""
    inside = (camera.t >= imu.t[0]) & (camera.t <= imu.t[-1])
    if np.sum(inside) < FEWEST or len(imu) < FEWEST:
        return
    turns = np.diff(camera.psi[inside])
    by_gyro = np.diff(np.interp(camera.t[inside], imu.t, integral(imu.t, imu.gyro[:, 2])))
    rad, deg = (
        float(np.abs(np.mean(np.exp(1j * (turns - k * by_gyro))))) for k in (1.0, np.degrees(1.0))
    )
    if deg > SAME_TURNS > rad:
        text = (
            f"its turns between poses are 57.3 times those of gyro z (agreement {deg:.2f} of 1, without the factor "
            f"{rad:.2f}): a heading in deg? make the quaternion from rad"
        )
        yield Problem("error", "camera_heading", camera.topic, text)


def _answer(trial: Trial) -> RotorResponse | None:
    """How gyro z answers the rotor, as measured or else as commanded; None where no strokes show it."""
    imu, commands, encoder = trial.imu, trial.commands, trial.encoder
    if imu is None or commands is None or min(len(imu), len(commands)) < FEWEST:
        return None
    t, speed = commands.t, commands.rotor_speed
    if encoder is not None and len(encoder) >= FEWEST:
        wanted = np.interp(encoder.t, t, speed)
        if correlation(wanted, encoder.speed) > FOLLOWS:
            t, speed = encoder.t, encoder.speed
    answer = rotor_response(t, speed, imu.t, imu.gyro[:, 2])
    sure = answer is not None and answer.coherence > ANSWERS and answer.share > STROKES
    return answer if sure else None


def _headings(imu: Imu, camera: Camera) -> tuple[Array, list[Array]] | None:
    """The camera's heading and the three integrated angular velocities at its times, all without trend; None: no turn.

    Over the longest stretch in which the IMU does not pause.
    """
    if len(imu) < FEWEST:
        return None
    ends = np.concatenate([[-1], np.flatnonzero(np.diff(imu.t) > PAUSE), [len(imu) - 1]])
    longest = int(np.argmax(imu.t[ends[1:]] - imu.t[ends[:-1] + 1]))
    start, end = imu.t[ends[longest] + 1], imu.t[ends[longest + 1]]
    inside = (camera.t >= start) & (camera.t <= end)
    t, psi = camera.t[inside], np.unwrap(camera.psi[inside])
    if len(t) < FEWEST:
        return None
    psi = without_trend(t, psi)
    if np.std(psi) < TURN_RAD:
        return None
    turned = [np.interp(t, imu.t, integral(imu.t, imu.gyro[:, axis])) for axis in range(3)]
    return psi, [without_trend(t, angle) for angle in turned]


def _gyro(imu: Imu, psi: Array, angles: list[Array]) -> Iterator[Problem]:
    """Axis and unit of the angular velocity."""
    followed = [correlation(psi, angle) for angle in angles]
    best = int(np.argmax(np.abs(followed)))
    if abs(followed[2]) < STRAYS and abs(followed[best]) > FOLLOWS:
        text = (
            f"its axis {'xyz'[best]} follows the camera's heading (correlation {followed[best]:.2f}), expected z: "
            "axes are swapped; turn them where the IMU is published"
        )
        yield Problem("error", "gyro_axes", imu.topic, text)
    elif abs(followed[2]) < STRAYS and np.std(psi) > STRAY_TURN_RAD:
        text = f"gyro z does not follow the camera's heading (correlation {followed[2]:.2f})"
        yield Problem("warning", "gyro", imu.topic, text)
    elif followed[2] > FOLLOWS:
        text = "gyro z, integrated, is {} times the camera's heading"
        slope = float(np.std(angles[2]) / np.std(psi))
        yield from unit_problem("gyro_unit", imu.topic, text, "rad/s", slope)


def _which_is_mirrored(
    imu: Imu,
    camera: Camera,
    answer: RotorResponse | None,
    felt: FeltAcceleration | None,
    follows: float | None,
) -> Problem:
    """Gyro and camera turn against each other: which of the two, by rotor, accelerometer and rudder."""
    camera_by, gyro_by = [], []
    if answer is not None:
        if abs(answer.phase) < WITH_ROTOR_RAD:
            gyro_by.append("the rotor's strokes")
        elif np.pi - abs(answer.phase) < WITH_ROTOR_RAD:
            camera_by.append("the rotor's strokes")
    if felt is not None:
        others = sorted(felt.likelihood.values())[-2]
        if felt.likelihood[felt.best] - others > SURE and felt.best in (MIRRORED, RECORDED):
            (camera_by if felt.best == MIRRORED else gyro_by).append("the accelerometer")
    if follows is not None and abs(follows) > RUDDER_FOLLOWS:
        (camera_by if follows < 0 else gyro_by).append("the rudder")
    if camera_by and not gyro_by:
        text = (
            f"the heading turns against gyro z, which {' and '.join(camera_by)} confirm: the camera's frame is "
            "left-handed; expected x along the pool, y left of it, z up: mirror the camera's calibration"
        )
        return Problem("error", "camera_axes", camera.topic, text)
    sure = f", which {' and '.join(gyro_by)} confirm" if gyro_by and not camera_by else ""
    which = "change the sign of gyro z" if sure else "one of them is mirrored"
    text = f"gyro z turns against the camera's heading{sure}; expected the same sign: {which}"
    return Problem("error", "gyro_sign", imu.topic, text)


def _rotor(commands: Commands, answer: RotorResponse | None, alone: bool) -> Iterator[Problem]:
    """Sign and size of the hull's answer to the rotor; `alone`: no camera says that the gyro is right."""
    if answer is None:
        return
    if abs(answer.phase) < WITH_ROTOR_RAD:
        which = "gyro z or the rotor has" if alone else "the rotor has"
        text = (
            f"the hull turns with the rotor (phase {np.degrees(answer.phase):.0f} deg, coherence "
            f"{answer.coherence:.2f}); expected against it: {which} the wrong sign"
        )
        yield Problem("error", "rotor_sign", commands.topic, text)
    elif answer.gain < (SMALL_GAIN if answer.swing > LARGEST_SWING_RAD else LEAST_GAIN):
        text = (
            f"the hull turns by {answer.gain:.2g} of the rotor's speed, which swings by {answer.swing:.3g} rad; "
            "expected 0.005 to 0.06, and swings below 20 rad: rotor speed in rpm or deg/s? publish rad/s"
        )
        yield Problem("warning", "rotor_unit", commands.topic, text)
    elif answer.gain > LARGEST_GAIN and alone:
        text = (
            f"the hull turns by {answer.gain:.2g} of the rotor's speed; expected 0.005 to 0.06: "
            "gyro in deg/s? publish rad/s"
        )
        yield Problem("warning", "gyro_unit", commands.topic, text)
