# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the water does, learned while swimming: a Kalman filter of the current and of the robot's own thrust.

State: w speed through the water along the mean heading psi, (c_x, c_y) current in the pool frame, e thrust beyond
the nominal robot's, a share. Throttle s (lagged by MOVE_TIME) and rudder alpha drive

    M w' = (1 + e) s - ff(w, alpha) + noise        ff: throttle that holds w (control_law)
    c', e' = noise

and fusion's velocity over ground (u, v) measures at every step

    u                = t . c + w                   t = (cos psi, sin psi)
    v + a(w) w kappa = n . c                       n = (-sin psi, cos psi); the slip of a turn taken off

On one heading a current ahead and a strong thrust look alike, and their spreads decide what is believed: a robot whose
thrust is not the nominal one takes part of it for a current. Once the heading has changed the two separate. At rest there is
no thrust: a fish that listens before its first stroke (GuidanceConfig.listen_time) knows the current by the drag that takes
it along, and its thrust from the first strokes, which the control law's feed-forward is divided by.

A flick of the rudder pushes the fish ahead and aside in ways that the models leave out (the start with 0.3 to 0.5 rad
gives 0.1 m/s); what is measured while the rudder moves therefore counts little.

Everything on generic scalars: training runs the same lines in CasADi, so that nothing branches on a value.

Source: extended Kalman filter; models and constants: this project, swimming of the nominal fish in simulation.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fish_control.control_law import (
    ControlLimits,
    Setpoint,
    feedforward_slope,
    feedforward_throttle,
)

LAG = 3.7  # s^2/m, M: a step of the throttle is answered within M / ff'(w), 2 s at 0.1 m/s
# s, for which a move of the rudder counts; also in which the rotor follows the throttle
MOVE_TIME = 0.3
# spreads at the start
SPEED_SPREAD = 0.2  # m/s, of w
CURRENT_SPREAD = 0.03  # m/s, of each component
THRUST_SPREAD = 1.0  # of e: wide, as a robot that is not the nominal one must not swim against a current that is none
# drifts, per root s
# m/s, of each component; a faster one takes the start of a strong robot for a current
CURRENT_DRIFT = 0.003
THRUST_DRIFT = 0.005  # of e
SPEED_DRIFT = 0.05  # m/s for each throttle, of w
TURN_DRIFT = 0.1  # m/s for each rad of rudder, of w
MOVE_DRIFT = 1.0  # m/s for each rad that the rudder has just moved, of w
# noises, times root s
SURGE_NOISE = 0.002  # m/s, of u: ripple of the stroke
SWAY_NOISE = 0.004  # m/s, of v: with CURRENT_DRIFT, a current across that changes is learned in a second and a half
MOVE_NOISE = 0.1  # m/s for each rad that the rudder has just moved, of v
EARLY_NOISE = 0.1  # m/s, times root s, of u and v at first: fusion starts with errors of 5 cm/s that last half a second
EARLY_TIME = 0.3  # s, in which it fades
THRUST_LIMIT = 2.0  # e stays within
SIZE, LAGGED = (
    4,
    3,
)  # numbers of the estimate; further numbers that are neither estimate nor covariance
UPPER = tuple((i, j) for i in range(SIZE) for j in range(i, SIZE))  # places of the covariance


class WaterState(NamedTuple):
    """Estimate and its covariance, upper triangle row by row."""

    speed: Any = 0.0  # w, m/s
    current_x: Any = 0.0  # m/s
    current_y: Any = 0.0  # m/s
    thrust: Any = 0.0  # e
    rudder: Any = 0.0  # rad, lagged by MOVE_TIME
    throttle: Any = 0.0  # lagged likewise
    early: Any = 1.0  # fades while the velocity over ground, an estimate itself, settles
    P00: Any = SPEED_SPREAD**2
    P01: Any = 0.0
    P02: Any = 0.0
    P03: Any = 0.0
    P11: Any = CURRENT_SPREAD**2
    P12: Any = 0.0
    P13: Any = 0.0
    P22: Any = CURRENT_SPREAD**2
    P23: Any = 0.0
    P33: Any = THRUST_SPREAD**2


def swim(state: WaterState, setpoint: Setpoint, dt: Any, limits: ControlLimits) -> WaterState:
    """Predict over dt [s]; implicit in the drag, so stable for any dt."""
    share = dt / (MOVE_TIME + dt)
    throttle = state.throttle + share * (setpoint.throttle - state.throttle)
    rudder = state.rudder + share * (setpoint.alpha - state.rudder)
    slope = feedforward_slope(state.speed, setpoint.alpha, limits)
    gain = dt / (LAG + dt * slope)
    push = (1.0 + state.thrust) * throttle - feedforward_throttle(
        state.speed, setpoint.alpha, limits
    )
    F_w, F_e = 1.0 - gain * slope, gain * throttle  # of the new speed by the old speed and by e
    P = _matrix(state)
    row = [F_w * P[0][k] + F_e * P[3][k] for k in range(SIZE)]
    row[0] = F_w * row[0] + F_e * (F_w * P[0][3] + F_e * P[3][3])
    for k in range(SIZE):
        P[0][k] = P[k][0] = row[k]
    moved = setpoint.alpha - state.rudder
    drift = (
        (SPEED_DRIFT * throttle) ** 2
        + (TURN_DRIFT * setpoint.alpha) ** 2
        + (MOVE_DRIFT * moved) ** 2
    )
    for k, variance in enumerate((drift, CURRENT_DRIFT**2, CURRENT_DRIFT**2, THRUST_DRIFT**2)):
        P[k][k] = P[k][k] + dt * variance
    early = state.early * (1.0 - dt / (EARLY_TIME + dt))
    return _state([state.speed + gain * push, *state[1:SIZE]], [rudder, throttle, early], P)


def see_ahead(state: WaterState, surge: Any, cos: Any, sin: Any, dt: Any) -> WaterState:
    """Correct with the surge over ground [m/s] of dt [s] at the mean heading (cos, sin)."""
    missing = surge - state.speed - cos * state.current_x - sin * state.current_y
    variance = (SURGE_NOISE**2 + (EARLY_NOISE * state.early) ** 2) / dt
    return _correct(state, (1.0, cos, sin, 0.0), missing, variance)


def see_across(state: WaterState, sway: Any, alpha: Any, cos: Any, sin: Any, dt: Any) -> WaterState:
    """Correct with the mean sway over ground less the slip [m/s] of dt [s] with the rudder's set-point at alpha [rad]."""
    missing = sway + sin * state.current_x - cos * state.current_y
    early = (EARLY_NOISE * state.early) ** 2
    variance = (SWAY_NOISE**2 + (MOVE_NOISE * (alpha - state.rudder)) ** 2 + early) / dt
    return _correct(state, (0.0, -sin, cos, 0.0), missing, variance)


def bounded(state: WaterState, limit: float, xp: Any) -> WaterState:
    """Each component of the current within +-limit [m/s], the thrust within +-THRUST_LIMIT."""

    def within(value: Any, most: float) -> Any:
        return xp.fmin(xp.fmax(value, -most), most)

    return state._replace(
        current_x=within(state.current_x, limit),
        current_y=within(state.current_y, limit),
        thrust=within(state.thrust, THRUST_LIMIT),
    )


def _correct(state: WaterState, h: tuple[Any, ...], missing: Any, variance: Any) -> WaterState:
    """Take in a measurement h . x [m/s] that exceeds its prediction by `missing`; variance [m^2/s^2]."""
    h_w, h_x, h_y, h_e = h
    Ph = [w * h_w + x * h_x + y * h_y + e * h_e for w, x, y, e in _matrix(state)]
    S = Ph[0] * h_w + Ph[1] * h_x + Ph[2] * h_y + Ph[3] * h_e + variance
    K = [value / S for value in Ph]
    x = [value + k * missing for value, k in zip(state[:SIZE], K, strict=True)]
    P = [value - K[i] * Ph[j] for value, (i, j) in zip(state[SIZE + LAGGED :], UPPER, strict=True)]
    return WaterState._make((*x, state.rudder, state.throttle, state.early, *P))


def _matrix(state: WaterState) -> list[list[Any]]:
    """The full covariance."""
    ww, wx, wy, we, xx, xy, xe, yy, ye, ee = state[SIZE + LAGGED :]
    return [[ww, wx, wy, we], [wx, xx, xy, xe], [wy, xy, yy, ye], [we, xe, ye, ee]]


def _state(x: list[Any], lagged: list[Any], P: list[list[Any]]) -> WaterState:
    w, x_row, y_row, e_row = P
    return WaterState._make((*x, *lagged, *w, *x_row[1:], *y_row[2:], e_row[3]))
