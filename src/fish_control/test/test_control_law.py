# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The control law: one expression for numpy and CasADi, limits, anti-windup, throttle map, phase."""

import casadi
import numpy as np
import pytest

from fish_control.control_law import (
    LEAST_THRUST,
    ActuatorState,
    ControlLimits,
    ControlState,
    Errors,
    Gains,
    Setpoint,
    actuator_step,
    amplitude_of_throttle,
    control_step,
    feedforward_slope,
    feedforward_throttle,
)

LIMITS = ControlLimits()
GAINS = Gains(0.3, 0.4, 0.05, 0.6, 0.07, 0.02)
AT_REST = Errors(0.0, 0.0, 0.0, 0.2)


def test_casadi_expression_is_the_numpy_function():
    sizes = len(ControlState._fields), len(Errors._fields), len(Gains._fields)
    symbols = [casadi.SX.sym("v", n) for n in sizes]
    state, setpoint = control_step(
        ControlState(*casadi.vertsplit(symbols[0])),
        Errors(*casadi.vertsplit(symbols[1])),
        Gains(*casadi.vertsplit(symbols[2])),
        0.02,
        LIMITS,
        casadi,
    )
    function = casadi.Function("step", symbols, [casadi.vertcat(*state, *setpoint)])
    rng = np.random.default_rng(0)
    for _ in range(20):
        values = [rng.normal(size=n) for n in sizes]
        here = control_step(
            ControlState(*values[0]), Errors(*values[1]), Gains(*values[2]), 0.02, LIMITS, np
        )
        np.testing.assert_allclose(
            function(*values).full().ravel(), [*here[0], *here[1]], rtol=1e-12, atol=1e-14
        )


def test_casadi_actuators_are_the_numpy_actuators():
    symbols = casadi.SX.sym("v", 5)
    v = casadi.vertsplit(symbols)
    state, speed = actuator_step(ActuatorState(*v[:3]), Setpoint(*v[3:]), 0.01, LIMITS, casadi)
    function = casadi.Function("act", [symbols], [casadi.vertcat(*state, speed)])
    values = np.array([0.1, 5.0, 2.0, -0.4, 0.7])
    here = actuator_step(ActuatorState(*values[:3]), Setpoint(*values[3:]), 0.01, LIMITS, np)
    np.testing.assert_allclose(function(values).full().ravel(), [*here[0], here[1]], rtol=1e-12)


def test_a_batch_gives_what_singles_give():
    rng = np.random.default_rng(1)
    state, errors = rng.normal(size=(8, 10)), rng.normal(size=(5, 10))
    batch = control_step(ControlState(*state), Errors(*errors), GAINS, 0.02, LIMITS, np)[1]
    single = control_step(
        ControlState(*state[:, 3]), Errors(*errors[:, 3]), GAINS, 0.02, LIMITS, np
    )[1]
    assert (batch.alpha[3], batch.throttle[3]) == pytest.approx(single)


def test_a_robot_twice_as_strong_gets_half_the_feed_forward_and_a_dead_one_not_all_there_is():
    def throttle(thrust):
        errors = Errors(0.0, 0.0, 0.0, 0.2, thrust)
        return control_step(ControlState(), errors, GAINS, 0.02, LIMITS, np)[1].throttle

    assert throttle(0.0) == pytest.approx(feedforward_throttle(0.2, 0.0, LIMITS))
    assert throttle(1.0) == pytest.approx(0.5 * throttle(0.0))
    assert throttle(-2.0) == pytest.approx(throttle(0.0) / LEAST_THRUST)


def test_proportional_part_has_the_stated_units():
    gains = Gains(0.3, 0, 0, 0.5, 0, 0)
    _, out = control_step(ControlState(), Errors(0.2, 0.03, 0.0, 0.0), gains, 0.02, LIMITS, np)
    assert out.alpha == pytest.approx(LIMITS.steering_scale * 0.3 * 0.2)
    turning = feedforward_throttle(0.0, out.alpha, LIMITS)
    assert out.throttle == pytest.approx(turning + LIMITS.throttle_scale * 0.5 * 0.03)


def test_integral_grows_as_the_integral_of_the_error():
    state, gains = ControlState(), Gains(0, 0.5, 0, 0, 0, 0)
    for _ in range(50):
        state, out = control_step(state, Errors(0.1, 0.0, 0.0, 0.2), gains, 0.02, LIMITS, np)
    assert out.alpha == pytest.approx(LIMITS.steering_scale * 0.5 * 0.1 * 1.0)


def test_a_change_of_integral_gain_does_not_jolt():
    state = ControlState()
    for _ in range(100):
        state, before = control_step(
            state, Errors(0.1, 0, 0, 0.2), Gains(0, 0.5, 0, 0, 0, 0), 0.02, LIMITS, np
        )
    _, after = control_step(
        state, Errors(0.1, 0, 0, 0.2), Gains(0, 0.1, 0, 0, 0, 0), 0.02, LIMITS, np
    )
    assert after.alpha == pytest.approx(before.alpha, abs=0.01)


def test_anti_windup_leaves_saturation_soon_after_the_error_changes_sign():
    def steps_until_negative(limits):
        state = ControlState()
        for _ in range(1000):  # 20 s hard over
            state, out = control_step(state, Errors(1.5, 0.0, 0.0, 0.2), GAINS, 0.02, limits, np)
        assert out.alpha == LIMITS.rudder_range
        for k in range(1000):
            state, out = control_step(state, Errors(-0.2, 0.0, 0.0, 0.2), GAINS, 0.02, limits, np)
            if out.alpha < 0.0:
                return k
        return 1000

    wound = ControlLimits(unwinding_rate=0.0, integral_limit=10.0)
    assert steps_until_negative(LIMITS) < 25 < 200 < steps_until_negative(wound)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_saturated_integral_settles_where_the_error_and_the_excess_balance(sign):
    """I' = Ki e + k_w (sat - unsat) / c = 0; to a period; the integral's own limit is not reached."""
    gains, heading, speed = (
        Gains(0.3, 0.04, 0, 0.6, 0.02, 0),
        1.5 * sign,
        0.5 if sign > 0.0 else -0.1,
    )
    state = ControlState()
    for _ in range(1000):
        state, out = control_step(state, Errors(heading, speed, 0.0, 0.0), gains, 0.02, LIMITS, np)
    turning = feedforward_throttle(0.0, out.alpha, LIMITS)
    for integral, error, kp, ki, scale, ahead, output in (
        (state.steering_integral, heading, 0.3, 0.04, LIMITS.steering_scale, 0.0, out.alpha),
        (state.speed_integral, speed, 0.6, 0.02, LIMITS.throttle_scale, turning, out.throttle),
    ):
        excess = ahead + scale * (kp * error + integral) - output
        assert excess == pytest.approx(scale * ki * error / LIMITS.unwinding_rate, rel=0.05)
        assert abs(integral) < 0.9 * LIMITS.integral_limit
    assert (out.alpha, out.throttle) == (sign * LIMITS.rudder_range, max(sign, 0.0))


@pytest.mark.parametrize(("speed", "throttle"), [(2.0, 1.0), (-2.0, 0.0)])
def test_throttle_stays_between_nothing_and_all_there_is(speed, throttle):
    errors = Errors(0.0, speed, 0.0, 0.2)
    assert control_step(ControlState(), errors, GAINS, 0.02, LIMITS, np)[1].throttle == throttle


def test_feedforward_of_water_that_overtakes_the_fish_is_the_opposite():
    for alpha in (0.0, 0.4):
        assert feedforward_throttle(-0.2, alpha, LIMITS) == -feedforward_throttle(
            0.2, alpha, LIMITS
        )


@pytest.mark.parametrize("speed", [0.15, -0.15])
@pytest.mark.parametrize("alpha", [0.0, 0.4])
def test_slope_of_the_feedforward_is_its_difference_quotient(speed, alpha):
    ends = [feedforward_throttle(speed + step, alpha, LIMITS) for step in (1e-6, -1e-6)]
    assert feedforward_slope(speed, alpha, LIMITS) == pytest.approx((ends[0] - ends[1]) / 2e-6)


def test_filters_do_not_overshoot_however_long_a_period_is():
    gains, before = Gains(0, 0, 0.5, 0, 0, 0), ControlState(primed=1.0)
    state, _out = control_step(before, Errors(0.1, 0.0, 2.0, 0.2), gains, 1.0, LIMITS, np)
    assert 0.0 < state.heading_error_rate < 0.1 / 1.0
    assert 0.0 < state.curvature < 2.0


def test_derivative_acts_on_a_ramp_and_not_on_the_first_sample():
    gains, state = Gains(0, 0, 0.5, 0, 0, 0), ControlState()
    state, first = control_step(state, Errors(1.0, 0, 0, 0.2), gains, 0.02, LIMITS, np)
    assert first.alpha == 0.0
    for k in range(100):
        state, out = control_step(
            state, Errors(1.0 + 0.1 * 0.02 * (k + 1), 0, 0, 0.2), gains, 0.02, LIMITS, np
        )
    assert out.alpha == pytest.approx(LIMITS.steering_scale * 0.5 * 0.1, rel=1e-3)


def test_curvature_acts_after_its_lag():
    state, travelled, gains = ControlState(), 0.0, Gains(0, 0, 0, 0, 0, 0)
    while state.curvature < (1.0 - np.exp(-1.0)) * 2.0:
        state, out = control_step(state, Errors(0.0, 0.0, 2.0, 0.2), gains, 0.005, LIMITS, np)
        travelled += 0.2 * 0.005
    assert travelled == pytest.approx(LIMITS.curvature_lag, abs=0.002)
    assert out.alpha == pytest.approx(LIMITS.curvature_gain * state.curvature)


@pytest.mark.parametrize("frequency", [1.0, 2.0, 3.0])
def test_throttle_map_is_the_models(frequency):
    """The rotor's acceleration A w^2 says the thrust, whatever the stroke's frequency."""
    limits = ControlLimits(frequency=frequency)
    w = 2.0 * np.pi * frequency
    s_max = (12.0 * (2.0 * np.pi * 2.0) ** 2) ** 2
    for s in (0.1, 0.5, 1.0):
        A = amplitude_of_throttle(s, limits, np)
        assert A**2 * w**4 == pytest.approx(s * s_max, rel=0.02)
    assert amplitude_of_throttle(0.0, limits, np) == 0.0


def test_a_rotor_without_frequency_stands_still():
    state, speed = actuator_step(
        ActuatorState(), Setpoint(0.0, 1.0), 0.01, ControlLimits(frequency=0.0), np
    )
    assert (state.amplitude, speed) == (0.0, 0.0)


def test_rotor_speed_at_full_throttle_is_the_models_oscillation():
    """phi_dot = A w sin(w t) with A = 12 rad at 2 Hz, after the amplitude has grown for half a second."""
    state, speeds = ActuatorState(), []
    for _ in range(200):
        state, speed = actuator_step(state, Setpoint(0.0, 1.0), 0.01, LIMITS, np)
        speeds.append(speed)
    t, w = 0.01 * np.arange(1, 201), 4.0 * np.pi
    np.testing.assert_allclose(speeds[60:], 12.0 * w * np.sin(w * t[60:]), atol=2e-3 * 12.0 * w)


def test_rotor_oscillates_at_its_frequency_whatever_the_amplitude_does():
    state, speeds, rng = ActuatorState(), [], np.random.default_rng(2)
    for _ in range(500):
        state, speed = actuator_step(state, Setpoint(0.0, rng.uniform(0.3, 1.0)), 0.01, LIMITS, np)
        speeds.append(speed)
    crossings = np.flatnonzero(np.diff(np.sign(speeds)) != 0)
    np.testing.assert_allclose(np.diff(crossings), 25, atol=1)  # half a period of 0.25 s
    assert state.phase == pytest.approx(2.0 * np.pi * 2.0 * 5.0)


def test_rotor_speed_has_no_jumps_when_the_throttle_jumps():
    """Also where the rotor is fastest: 0.56 s and 1.62 s are a quarter of a period past a whole one."""
    state, last = ActuatorState(), 0.0
    w = 2.0 * np.pi * LIMITS.frequency
    largest = LIMITS.amplitude_rate * w * 0.01 + 12.0 * w * w * 0.01
    for throttle in [0.2] * 56 + [1.0] * 106 + [0.0] * 100 + [0.5] * 50:
        state, speed = actuator_step(state, Setpoint(0.0, throttle), 0.01, LIMITS, np)
        assert abs(speed - last) <= largest
        last = speed


def test_full_stop_within_half_a_second():
    state = ActuatorState(amplitude=12.0)
    for _ in range(51):
        state, speed = actuator_step(state, Setpoint(0.0, 0.0), 0.01, LIMITS, np)
    assert state.amplitude == pytest.approx(0.0, abs=1e-12)
    assert speed == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rudder_and_amplitude_move_at_their_rates(sign):
    state, _ = actuator_step(
        ActuatorState(amplitude=6.0), Setpoint(0.8 * sign, 0.5 + 0.5 * sign), 0.01, LIMITS, np
    )
    assert state.alpha == pytest.approx(sign * LIMITS.rudder_rate * 0.01)
    assert state.amplitude == pytest.approx(6.0 + sign * LIMITS.amplitude_rate * 0.01)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rudder_range", float("nan")),
        ("throttle_scale", float("inf")),
        ("unwinding_rate", -0.1),
        ("curvature_gain", 0.0),
    ],
)
def test_limits_name_field_and_value(field, value):
    with pytest.raises(ValueError, match=f"{field} is {value!r}, expected a"):
        ControlLimits(**{field: value})
