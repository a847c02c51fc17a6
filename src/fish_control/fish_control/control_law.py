# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From errors and gains to rudder and rotor: two PIDs, feed-forward, throttle map, actuator limits.

Everything is written on generic scalars: `xp` is numpy or casadi (anything with fmin, fmax, sin, sqrt),
without a branch on a value, so that training differentiates exactly what the controller node runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from fish_control.stroke_mean import STROKE_FREQUENCY

TINY = 1e-9  # m, keeps a share of nothing at zero
LEAST_THRUST = 0.5  # of the nominal robot's; a weaker one is not believed
AMPLITUDE_AT_FULL_THROTTLE = 12.0  # rad, MODEL: S_max = (12 rad (2 pi 2 Hz)^2)^2


@dataclass(frozen=True)
class ControlLimits:
    """Constants of the control law, part of a weights file's contract; feed-forward from the nominal fish."""

    steering_scale: float = 2.0  # rad of rudder for a steering PID output of 1
    throttle_scale: float = 4.0  # throttle for a speed PID output of 1
    curvature_gain: float = 0.21  # m, rudder for a path curvature: alpha = gain kappa; steady turns
    curvature_lag: float = (
        0.062  # m, lag of that curvature along the path: a rudder step yaws at once
    )
    throttle_linear: float = (
        1.333  # s/m, throttle for a speed u: linear u + quadratic u^2; straight
    )
    throttle_quadratic: float = 2.13  # s^2/m^2
    turn_linear: float = 1.2  # s/(m rad^2), and in turns: alpha^2 (linear u + quadratic u^2)
    turn_quadratic: float = 10.0  # s^2/(m^2 rad^2)
    derivative_time: float = 0.15  # s, first-order filter of both derivatives
    integral_limit: float = 0.1  # of the PID output, both integrals
    unwinding_rate: float = 2.0  # 1/s, how fast an integral gives way to a saturated output
    rudder_range: float = 0.8  # rad, MODEL
    rudder_rate: float = 6.0  # rad/s, MODEL: the servo's limit
    amplitude_rate: float = 24.0  # rad/s, of the rotor's oscillation; full stop within 0.5 s
    frequency: float = STROKE_FREQUENCY  # Hz

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{field.name} is {value!r}, expected a finite number >= 0")
        if self.curvature_gain == 0.0:
            raise ValueError("curvature_gain is 0.0, expected a number > 0")


class Gains(NamedTuple):
    """[Kp, Ki, Kd] of steering (error in rad, output in steering_scale rad) and speed (error in m/s)."""

    steering_kp: Any
    steering_ki: Any
    steering_kd: Any
    speed_kp: Any
    speed_ki: Any
    speed_kd: Any


class Errors(NamedTuple):
    """What the planner says."""

    heading: Any  # rad, wanted minus actual course, within +-pi
    speed: Any  # m/s, wanted minus actual surge
    curvature: Any  # 1/m, of the way through the water where the rudder will act
    speed_wanted: Any  # m/s, through the water
    thrust: Any = 0.0  # e, own thrust beyond the nominal robot's, a share (water)


class ControlState(NamedTuple):
    """Memory of both PIDs; `primed` is 0 before the first step, whose derivatives are taken as zero."""

    steering_integral: Any = 0.0
    heading_error: Any = 0.0
    heading_error_rate: Any = 0.0
    speed_integral: Any = 0.0
    speed_error: Any = 0.0
    speed_error_rate: Any = 0.0
    primed: Any = 0.0
    curvature: Any = 0.0  # 1/m, lagged


class Setpoint(NamedTuple):
    """What the actuators are to reach."""

    alpha: Any  # rad, > 0 steers left
    throttle: Any  # s in [0, 1]


class ActuatorState(NamedTuple):
    """What was last commanded."""

    alpha: Any = 0.0  # rad
    amplitude: Any = 0.0  # rad, A of the rotor's oscillation
    phase: Any = 0.0  # rad


def control_step(
    state: ControlState, errors: Errors, gains: Gains, dt: Any, limits: ControlLimits, xp: Any
) -> tuple[ControlState, Setpoint]:
    """One period of both PIDs, dt [s].

    alpha    = sat[ k_kappa kappa_lag + c_a (Kp e + I + Kd e') ],  I' = Ki e + k_w (sat - unsat) / c_a
    throttle = sat[ ff(u_wanted, alpha) / (1 + e) + c_s (Kp e_u + I_u + Kd e_u') ],  e: thrust beyond the nominal
    """
    heading_rate = _filtered_rate(
        state.heading_error_rate, state.heading_error, errors.heading, state.primed, dt, limits
    )
    speed_rate = _filtered_rate(
        state.speed_error_rate, state.speed_error, errors.speed, state.primed, dt, limits
    )
    travelled = errors.speed_wanted * dt
    share = travelled / (limits.curvature_lag + travelled + TINY)
    curvature = state.curvature + share * (errors.curvature - state.curvature)
    alpha, steering_integral = _pid(
        limits.curvature_gain * curvature,
        (errors.heading, state.steering_integral, heading_rate),
        (gains.steering_kp, gains.steering_ki, gains.steering_kd),
        limits.steering_scale,
        (-limits.rudder_range, limits.rudder_range),
        dt,
        limits,
        xp,
    )
    throttle, speed_integral = _pid(
        feedforward_throttle(errors.speed_wanted, alpha, limits)
        / xp.fmax(1.0 + errors.thrust, LEAST_THRUST),
        (errors.speed, state.speed_integral, speed_rate),
        (gains.speed_kp, gains.speed_ki, gains.speed_kd),
        limits.throttle_scale,
        (0.0, 1.0),
        dt,
        limits,
        xp,
    )
    after = ControlState(
        steering_integral,
        errors.heading,
        heading_rate,
        speed_integral,
        errors.speed,
        speed_rate,
        1.0,
        curvature,
    )
    return after, Setpoint(alpha, throttle)


def feedforward_throttle(speed: Any, alpha: Any, limits: ControlLimits) -> Any:
    """Throttle that holds `speed` [m/s] with the rudder at alpha [rad].

        s = a u + b u |u| + alpha^2 (c u + d u |u|)

    Source: this project, steady swimming of the nominal fish; within 0.05 for u to 0.3 m/s.
    """
    square = speed * abs(speed)  # water that overtakes the fish drags it ahead
    straight = limits.throttle_linear * speed + limits.throttle_quadratic * square
    return straight + alpha**2 * (limits.turn_linear * speed + limits.turn_quadratic * square)


def feedforward_slope(speed: Any, alpha: Any, limits: ControlLimits) -> Any:
    """Derivative of `feedforward_throttle` with the speed [s/m]."""
    straight = limits.throttle_linear + 2.0 * limits.throttle_quadratic * abs(speed)
    return straight + alpha**2 * (limits.turn_linear + 2.0 * limits.turn_quadratic * abs(speed))


def amplitude_of_throttle(throttle: Any, limits: ControlLimits, xp: Any) -> Any:
    """A [rad] from A^2 w^4 = s S_max, S_max = (12 w_0^2)^2; smooth at s = 0, where the root is not."""
    ratio = (STROKE_FREQUENCY / limits.frequency) ** 2 if limits.frequency > 0.0 else 0.0
    tiny = 1e-6
    return AMPLITUDE_AT_FULL_THROTTLE * ratio * (xp.sqrt(throttle + tiny) - math.sqrt(tiny))


def actuator_step(
    state: ActuatorState, setpoint: Setpoint, dt: Any, limits: ControlLimits, xp: Any
) -> tuple[ActuatorState, Any]:
    """Move the commands towards the set-point for dt [s]: new state and phi_dot = A w sin(phase) [rad/s].

    The phase always advances by w dt; a change of throttle changes the amplitude only, at a bounded rate.
    """
    w = 2.0 * math.pi * limits.frequency
    alpha = _towards(state.alpha, setpoint.alpha, limits.rudder_rate * dt, xp)
    wanted = amplitude_of_throttle(setpoint.throttle, limits, xp)
    amplitude = _towards(state.amplitude, wanted, limits.amplitude_rate * dt, xp)
    phase = state.phase + w * dt
    return ActuatorState(alpha, amplitude, phase), amplitude * w * xp.sin(phase)


def _towards(value: Any, goal: Any, step: Any, xp: Any) -> Any:
    return value + xp.fmin(xp.fmax(goal - value, -step), step)


def _filtered_rate(
    rate: Any, before: Any, now: Any, primed: Any, dt: Any, limits: ControlLimits
) -> Any:
    """Rate of an error through a first-order filter; of an angle the caller avoids jumps by 2 pi."""
    raw = primed * (now - before) / dt
    return rate + (raw - rate) * dt / (limits.derivative_time + dt)


def _pid(
    feedforward: Any,
    terms: tuple[Any, Any, Any],
    gains: tuple[Any, Any, Any],
    scale: float,
    span: tuple[float, float],
    dt: Any,
    limits: ControlLimits,
    xp: Any,
) -> tuple[Any, Any]:
    """Saturated output and new integral (in output units, so that a change of gain does not jolt)."""
    error, integral, rate = terms
    kp, ki, kd = gains
    integral = integral + dt * ki * error
    wanted = feedforward + scale * (kp * error + integral + kd * rate)
    output = xp.fmin(xp.fmax(wanted, span[0]), span[1])
    integral = integral + dt * limits.unwinding_rate * (output - wanted) / scale
    return output, xp.fmin(xp.fmax(integral, -limits.integral_limit), limits.integral_limit)
