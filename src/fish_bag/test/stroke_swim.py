# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A kinematic swim for tests: a fish that strokes, turns and changes its speed, and what noisy sensors say of it.

Its rotor turns the hull against itself, its path is the integral of its speed, and its accelerometer feels the path's second
derivative. Nothing of the simulator is used.
"""

from dataclasses import dataclass

import numpy as np

from fish_bag.trial import Camera, Commands, Encoder, Imu, Tail, Trial

STEP = 0.01
STROKE = 2.0 * np.pi * 2.0  # rad/s
GAIN = 0.035  # yaw rate of the hull to the rotor's speed
START = 0.1  # s; the first sample


@dataclass(frozen=True)
class Course:
    """What the fish does: amplitude of its turns [rad] and of its changes of speed [m/s]."""

    duration: float = 20.0
    turns: float = 1.2
    speeds: float = 0.08
    rotor: float = 70.0  # rad/s, amplitude of the rotor's speed


def motion(course):
    """(t, rotor speed, rate of turn, yaw rate, heading, place, specific force) of a course; place and force are complex."""
    t = START + np.arange(0.0, course.duration, STEP)
    rotor = -course.rotor * np.sin(STROKE * t)
    turn_rate = 0.5 * course.turns * np.cos(0.5 * t)
    rate = turn_rate - GAIN * rotor
    psi = 0.3 + STEP * np.cumsum(rate)
    surge = 0.2 + course.speeds * np.sin(0.7 * t)
    sway = 4e-4 * course.rotor * np.sin(STROKE * t + 0.4) - 0.02 * turn_rate
    velocity = (surge + 1j * sway) * np.exp(1j * psi)
    place = -0.5 - 0.5j + STEP * np.cumsum(velocity)
    return t, rotor, turn_rate, rate, psi, place, np.gradient(velocity, STEP) * np.exp(-1j * psi)


def stroke_swim(course=Course(), seed=5):
    """The trial of a faultless robot."""
    random = np.random.default_rng(seed)
    t, rotor, turn_rate, rate, psi, place, force = motion(course)
    kept = random.random(len(t[::3])) > 0.02

    def noisy(values, sd):
        return values + sd * random.standard_normal(np.shape(values))

    def stream(kind, topic, at, **values):
        flags = np.zeros(len(at), np.uint8)
        return kind(topic=f"/fish/{topic}", frame_id="", t=at, t_arrival=at, flags=flags, **values)

    seen = np.column_stack([place.real, place.imag, psi])[::3][kept]
    seen = noisy(seen, np.array([0.002, 0.002, 0.012]))
    zero = np.zeros_like(t)
    gyro = noisy(np.column_stack([zero, zero, rate]), 0.006) + [0.01, -0.004, 0.008]
    accel = noisy(np.column_stack([force.real, force.imag, zero + 9.81]), 0.05) + [0.1, -0.2, 0.05]
    rudder = 0.6 * turn_rate / max(np.ptp(turn_rate), 1e-9)
    angle = course.rotor / STROKE * np.cos(STROKE * t)
    wrapped = np.mod(seen[:, 2] + np.pi, 2 * np.pi) - np.pi
    covariance = np.zeros((len(seen), 3, 3))
    return Trial(
        name="swim",
        path=None,
        origin_ns=0,
        duration=course.duration,
        namespace="/fish",
        axis="robot",
        commands=stream(
            Commands,
            "joint_command",
            t,
            rotor_phase=STROKE * t,
            rotor_speed=rotor,
            rudder=rudder,
        ),
        encoder=stream(Encoder, "joint_states", t, angle=angle, speed=noisy(rotor, 0.1)),
        imu=stream(Imu, "imu/data", t, gyro=gyro, accel=accel, orientation=np.zeros((len(t), 4))),
        camera=stream(
            Camera,
            "camera/pose",
            t[::3][kept],
            x=seen[:, 0],
            y=seen[:, 1],
            psi=wrapped,
            covariance=covariance,
        ),
        tail=stream(
            Tail,
            "camera/tail",
            t[::3],
            names=("tail_1",),
            angle=noisy(-rudder[::3] + 0.1 * np.sin(STROKE * t[::3]), 0.02)[:, None],
        ),
    )
