# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The control law, the controller that uses it, and files of gains."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import casadi
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

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
from fish_control.controller import Controller, Reference, continued
from fish_control.gains_file import GainsFileError, read_gains_file, require_fit, write_gains_file
from fish_control.hand_tuned import HAND_TUNED
from fish_control.line_of_sight import GuidanceConfig, Motion, slip_lever
from fish_control.policy import Policy, policy_inputs, tensor_shapes
from fish_control.policy_spec import HIDDEN, INPUTS, ContractError, PolicySpec
from fish_control.stroke_mean import TURN_LAG

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


CONTROLLER_GAINS = Gains(0.3, 0.4, 0.03, 0.6, 0.07, 0.0)
LISTENS = Policy.constant(CONTROLLER_GAINS)
POLICY = Policy.constant(
    CONTROLLER_GAINS, PolicySpec(layers=(), guidance=GuidanceConfig(listen_time=0.0))
)
STRAIGHT = Reference(0.0, 0.2, 0.0, 0.0)


def controller(heading=0.0, surge=0.2, policy=POLICY):
    made = Controller(policy)
    for k in range(3):
        made.observe(0.01 * k, Motion(0.0, 0.0, heading, surge, 0.0, 0.0))
    return made


def test_it_steers_towards_the_wanted_course():
    for course in (0.3, -0.3):
        made = controller()
        made.decide(Reference(course, 0.2, 0.0, 0.0))
        assert np.sign(made.command(0.01).alpha) == np.sign(course)


def test_gains_stay_within_limits_that_are_set():
    made = controller()
    made.limit_gains([0.0, 0.0, 0.0, 0.7, 0.0, 0.01], [0.2, 9.0, 9.0, 9.0, 9.0, 9.0])
    assert made.decide(STRAIGHT) == pytest.approx((0.2, 0.4, 0.03, 0.7, 0.07, 0.01))


def test_gains_are_the_policys():
    assert controller().decide(STRAIGHT) == pytest.approx(CONTROLLER_GAINS)


def test_a_slow_fish_gets_more_throttle():
    def rotor(surge):
        made = controller(surge=surge)
        for _ in range(25):
            made.decide(STRAIGHT)
            speeds = [made.command(0.01).rotor_speed for _ in range(2)]
        return np.abs(speeds).max()

    assert rotor(0.1) > rotor(0.2) > rotor(0.3)


def test_a_fish_at_rest_listens_before_its_first_stroke_and_one_under_way_does_not():
    made, moved = controller(surge=0.0, policy=LISTENS), []
    for k in range(3, 500):
        made.observe(0.01 * k, Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        assert made.decide(STRAIGHT) == pytest.approx(CONTROLLER_GAINS)
        moved.append(made.command(0.01).rotor_speed != 0.0)
    listened = LISTENS.contract.guidance.listen_time
    assert 0.01 * moved.index(True) == pytest.approx(listened, abs=0.05)
    assert listened > 1.0
    made = controller(surge=0.2, policy=LISTENS)
    made.decide(STRAIGHT)
    assert made.command(0.01).rotor_speed != 0.0


def test_rest_stops_rotor_and_centres_rudder_within_half_a_second():
    made = controller()
    for _ in range(50):
        made.decide(Reference(1.0, 0.2, 0.0, 0.0))
        made.command(0.02)
    made.rest()
    for _ in range(60):
        command = made.command(0.01)
    assert command.rotor_speed == pytest.approx(0.0, abs=1e-9)
    assert command.alpha == 0.0


def test_a_fish_that_swims_does_not_stop_to_listen_again():
    made = controller(surge=0.2, policy=LISTENS)
    made.decide(STRAIGHT)
    for k in range(3, 20):  # something holds it
        made.observe(0.01 * k, Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        made.decide(STRAIGHT)
        command = made.command(0.01)
    assert abs(command.rotor_speed) > 10.0  # rad/s


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_gliding_holds_the_rudder_without_drive_until_the_fish_has_stopped(side):
    made = controller(surge=0.15)
    made.decide(STRAIGHT)
    for _ in range(60):
        made.glide(0.5 * side, 0.01)
        command = made.command(0.01)
    assert command.rotor_speed == pytest.approx(0.0, abs=1e-9)
    assert command.alpha == 0.8 * side
    angles = []
    for k in range(500):  # noise about standing still does not start it again
        made.observe(1.0 + 0.01 * k, Motion(0.0, 0.0, 0.0, 0.015 + 0.03 * (k % 2), 0.0, 0.0))
        made.glide(0.5 * side, 0.01)
        angles.append(made.command(0.01).alpha)
    np.testing.assert_allclose(np.diff(angles[:300]), -0.002 * side, atol=1e-9)
    assert angles[-1] == 0.0
    made.observe(7.0, Motion(0.0, 0.0, 0.0, 0.15, 0.0, 0.0))
    made.decide(STRAIGHT)
    for _ in range(60):  # after the next path it does the same
        made.glide(0.5 * side, 0.01)
        command = made.command(0.01)
    assert command.alpha == 0.8 * side


def test_gliding_straight_on_when_no_turn_is_wanted():
    made = controller(surge=0.15)
    made.glide(0.0, 0.01)
    assert made.command(0.01) == (pytest.approx(2 * np.pi * 0.02), 0.0, 0.0)


def test_curvature_is_fed_forward():
    lever = slip_lever(0.2, POLICY.contract.guidance) - TURN_LAG * 0.2
    made = controller(heading=lever * 2.0)
    for _ in range(100):
        made.decide(Reference(0.0, 0.2, 0.4, 0.0))
        command = made.command(0.02)
    # a speed that comes from nowhere is taken for a current of 4 mm/s, so that the water asks for a little more
    assert command.alpha == pytest.approx(POLICY.contract.limits.curvature_gain * 2.0, rel=0.08)


def test_decide_before_odometry_is_an_error_of_the_caller():
    with pytest.raises(ValueError, match="before any odometry"):
        Controller(POLICY).decide(STRAIGHT)


def test_phase_is_published_within_one_turn():
    made = controller()
    phases = [made.command(0.01).phase for _ in range(200)]
    t = 0.01 * np.arange(1, 201)
    np.testing.assert_allclose(np.exp(1j * np.array(phases)), np.exp(4j * np.pi * t), atol=1e-9)
    assert 0.0 <= min(phases)
    assert max(phases) < 2.0 * np.pi


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_fish_that_faces_backwards_keeps_turning_the_same_way(side):
    errors, e = [], 0.0
    for k in range(400):  # facing pi, swinging by 0.3 rad
        measured = side * (np.pi - 0.1 + 0.3 * np.sin(0.25 * k))
        e = continued(e, float(np.arctan2(np.sin(measured), np.cos(measured))))
        errors.append(e)
    assert np.all(side * np.array(errors) > 2.0)


def test_continued_error_comes_back_within_reach():
    assert continued(3.0, -2.0) == -2.0
    assert continued(-3.0, 2.0) == 2.0
    assert continued(3.0, -3.1) == pytest.approx(2 * np.pi - 3.1)
    assert continued(0.1, 0.2) == pytest.approx(0.2)


def test_the_module_writes_them_as_a_weights_file(tmp_path):
    file = tmp_path / "w.safetensors"
    subprocess.run([sys.executable, "-m", "fish_control.hand_tuned", str(file)], check=True)
    assert read_gains_file(file).gains([0.0] * 6) == HAND_TUNED


CONSTANT = Gains(0.3, 0.4, 0.03, 0.6, 0.07, 0.0)


@pytest.fixture
def network():
    rng = np.random.default_rng(0)
    contract = PolicySpec(training_seed=7, robot_hash="abc", note="test")
    tensors = {name: rng.normal(0.0, 0.2, shape) for name, shape in tensor_shapes(contract).items()}
    return Policy(contract, tensors)


def rewritten(file, change_contract=None, change_tensors=None):
    """The file with its contract or tensors changed behind the writer's back."""
    tensors = dict(load_file(file))
    contract = read_gains_file(file).contract.to_json()
    if change_contract:
        contract = json.loads(json.dumps(contract))
        change_contract(contract)
    if change_tensors:
        change_tensors(tensors)
    save_file(tensors, file, metadata={"contract": json.dumps(contract)})
    return file


def test_a_network_survives_the_file(network, tmp_path):
    write_gains_file(tmp_path / "w.safetensors", network)
    again = read_gains_file(tmp_path / "w.safetensors")
    assert again.contract == network.contract
    x = np.random.default_rng(1).normal(size=(5, 6))
    np.testing.assert_array_equal(again.gains(x), network.gains(x))


def test_constant_gains_are_the_same_format(tmp_path):
    write_gains_file(tmp_path / "c.safetensors", Policy.constant(CONSTANT))
    policy = read_gains_file(tmp_path / "c.safetensors")
    assert policy.contract.layers == ()
    assert policy.gains(np.zeros(6)) == pytest.approx(CONSTANT)
    assert policy.gains(np.zeros((3, 6))).speed_kp.shape == (3,)


def test_network_is_relu_then_tanh_scaled_to_the_ranges(network):
    x = np.random.default_rng(2).normal(size=6)
    h = x
    for k in range(3):
        w, b = network.tensors[f"layers.{k}.weight"], network.tensors[f"layers.{k}.bias"]
        h = np.array(
            [max(sum(w[i, j] * h[j] for j in range(len(h))) + b[i], 0.0) for i in range(len(b))]
        )
    raw = network.tensors["layers.3.weight"] @ h + network.tensors["layers.3.bias"]
    high = np.array([1.0, 1.0, 1.0, 2.5, 0.1, 0.1])
    np.testing.assert_allclose(network.gains(x), high / (1.0 + np.exp(-2.0 * raw)), rtol=1e-12)


def test_gains_stay_in_their_ranges_for_any_input(network):
    gains = np.array(network.gains(np.random.default_rng(3).normal(0.0, 100.0, (1000, 6))))
    low = np.array([o.low for o in network.contract.outputs])
    high = np.array([o.high for o in network.contract.outputs])
    assert np.all(gains.T >= low)
    assert np.all(gains.T <= high)


def test_network_has_the_papers_layers(network):
    assert HIDDEN == (6, 128, 128, 64, 6)
    assert (
        sum(t.size for t in network.tensors.values())
        == 6 * 128 + 128 + 128 * 128 + 128 + 128 * 64 + 64 + 64 * 6 + 6
    )


def test_inputs_are_normalised_in_the_papers_order():
    values = [2.0 * np.pi + 0.3, 0.15, 0.2, -0.25, 0.05, 0.02]
    expected = [0.3 / np.pi, 0.5, 0.2 / 0.3, -0.5, 0.5, 0.2]
    assert [i.name for i in INPUTS][:3] == ["head_angle", "surge_speed", "desired_speed"]
    np.testing.assert_allclose(policy_inputs(*values, np), expected, atol=1e-12)


def test_missing_file(tmp_path):
    with pytest.raises(GainsFileError, match=r"nowhere.safetensors: cannot be read"):
        read_gains_file(tmp_path / "nowhere.safetensors")


@pytest.mark.parametrize("content", [b"", b"hello", b"\xff" * 200])
def test_file_that_is_no_safetensors(tmp_path, content):
    (tmp_path / "x.safetensors").write_bytes(content)
    with pytest.raises(GainsFileError, match="not a safetensors file"):
        read_gains_file(tmp_path / "x.safetensors")


def test_truncated_file(network, tmp_path):
    file = tmp_path / "w.safetensors"
    write_gains_file(file, network)
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(GainsFileError, match="not a safetensors file"):
        read_gains_file(file)


def test_file_without_contract(tmp_path):
    save_file({"gains": np.zeros(6)}, tmp_path / "x.safetensors")
    with pytest.raises(GainsFileError, match="no contract"):
        read_gains_file(tmp_path / "x.safetensors")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda c: c.update(format_version=1),
            "version 1, expected 'fish_control/gains' version 3",
        ),
        (lambda c: c.pop("lookahead"), "contract lacks lookahead"),
        (lambda c: c.update(colour="red"), "contract has unknown colour"),
        (lambda c: c["limits"].pop("rudder_range"), "limits lacks rudder_range"),
        (lambda c: c["limits"].update(rudder_range=-1.0), "rudder_range is -1.0"),
        (lambda c: c["outputs"][0].update(name="kp"), "outputs are"),
        (lambda c: c.update(layers=[6, 128, 5]), "expected 6 inputs first and 6 gains last"),
        (lambda c: c.update(layers=[6, 6]), "layers.1.weight is"),
        (lambda c: c.update(activation="tanh"), "activation is 'tanh', expected 'relu'"),
        (lambda c: c["inputs"][1].update(scale=0.0), "input surge_speed has scale 0.0"),
        (lambda c: c.update(layers=None), "layers is None, expected a list"),
        (
            lambda c: c.update(layers=[6]),
            r"layers are \[6\], expected 6 inputs first and 6 gains last",
        ),
        (
            lambda c: c.update(layers=[6, 8.0, 6]),
            r"layers are \[6, 8.0, 6\], expected whole numbers > 0",
        ),
        (lambda c: c.update(inputs=3), "inputs is 3, expected a list"),
        (lambda c: c.update(inputs=[3]), "input is 3, expected an object"),
        (lambda c: c.update(outputs="all"), "outputs is 'all', expected a list"),
        (lambda c: c.update(limits=None), "limits is None, expected an object"),
        (
            lambda c: c["limits"].update(rudder_range="wide"),
            "limits: rudder_range is 'wide', expected a number",
        ),
        (
            lambda c: c["guidance"].update(slip_arm=None),
            "guidance: slip_arm is None, expected a number",
        ),
        (
            lambda c: c["guidance"].update(learn_current=1),
            "learn_current is 1, expected true or false",
        ),
        (lambda c: c["inputs"][1].update(scale="1"), "input: scale is '1', expected a number"),
        (lambda c: c.update(lookahead=True), "lookahead is True, expected a number"),
        (lambda c: c.update(robot_hash=5), "robot_hash is 5, expected a text"),
    ],
)
def test_contract_that_differs_says_what(network, tmp_path, change, said):
    write_gains_file(tmp_path / "w.safetensors", network)
    with pytest.raises(GainsFileError, match=said):
        read_gains_file(rewritten(tmp_path / "w.safetensors", change_contract=change))


def test_one_layer_is_no_network_even_without_arrays(tmp_path):
    file = tmp_path / "w.safetensors"
    write_gains_file(file, Policy.constant(CONSTANT))
    with pytest.raises(GainsFileError, match=r"layers are \[6\], expected 6 inputs first"):
        read_gains_file(rewritten(file, lambda c: c.update(layers=[6]), lambda t: t.pop("gains")))


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o002, 0o664), (0o077, 0o600)])
def test_a_written_file_is_for_those_whom_the_umask_leaves(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        write_gains_file(tmp_path / "w.safetensors", Policy.constant(CONSTANT))
    finally:
        os.umask(before)
    assert (tmp_path / "w.safetensors").stat().st_mode & 0o777 == mode
    assert [f.name for f in tmp_path.iterdir()] == ["w.safetensors"]


def test_arrays_that_numpy_does_not_know_are_refused(tmp_path):
    contract = json.dumps(PolicySpec(layers=()).to_json())
    gains = {"dtype": "BF16", "shape": [6], "data_offsets": [0, 12]}
    header = json.dumps({"__metadata__": {"contract": contract}, "gains": gains}).encode()
    file = tmp_path / "w.safetensors"
    file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(12))
    with pytest.raises(GainsFileError, match=r"bfloat16.*expected float64"):
        read_gains_file(file)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.pop("layers.2.bias"), "layers.2.bias is missing, expected \\(64,\\)"),
        (lambda t: t.update(extra=np.zeros(2)), "extra is \\(2,\\), expected none"),
        (
            lambda t: t["layers.0.weight"].__setitem__((0, 0), np.nan),
            "layers.0.weight has values that are not finite",
        ),
    ],
)
def test_arrays_that_differ_say_which(network, tmp_path, change, said):
    write_gains_file(tmp_path / "w.safetensors", network)
    with pytest.raises(GainsFileError, match=said):
        read_gains_file(rewritten(tmp_path / "w.safetensors", change_tensors=change))


def test_constant_gain_out_of_range_is_refused(tmp_path):
    with pytest.raises(GainsFileError, match="speed_kp is 9, expected within"):
        write_gains_file(
            tmp_path / "c.safetensors", Policy.constant(CONSTANT._replace(speed_kp=9.0))
        )


def test_every_difference_to_the_controller_is_listed(network):
    with pytest.raises(GainsFileError) as refusal:
        require_fit(network, "w.safetensors", 0.01, 0.3, "def")
    for said in ("control period is 0.02", "runs at 0.01", "lookahead is 0.4", "robot hash is abc"):
        assert said in str(refusal.value)
    require_fit(network, "w.safetensors", 0.02, 0.4, "abc")
    require_fit(network, "w.safetensors", 0.02, 0.4)


def test_other_inputs_are_refused():
    contract = PolicySpec(inputs=tuple(replace(i, name=i.name + "_x") for i in INPUTS))
    assert "inputs are" in contract.differences(0.02, 0.4)[0]


def test_contract_survives_json():
    contract = PolicySpec(training_seed=3, note="n")
    assert PolicySpec.from_json(json.loads(json.dumps(contract.to_json()))) == contract
    with pytest.raises(ContractError, match="expected an object"):
        PolicySpec.from_json([1])
