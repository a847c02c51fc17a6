# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects: each against its equation, the contract that all keep, one of a user's own, the water's push, the walls."""

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from scipy.signal import lsim

from fish_node import pool
from fish_node.pool import LENGTH, WIDTH
from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.effects.surroundings import BASIN_LENGTH, BASIN_WIDTH
from fish_sim.model import DT
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot, parameter_names
from fish_sim.robot_file import load_robot
from fish_sim.scheme import stable_scheme
from fish_sim.simulation import APART, EDGE, Readings, Simulation, Walls
from fish_sim.simulation_config import SimulationConfig
from fish_sim.step import Scheme, Stepper
from fish_sim.water_push import WaterPush

STILL = Drive(0.0, 0.0, 0.0, 0.0)


def namespace(name, **values):
    """Parameters of an effect: the given ones, typical strengths otherwise."""
    table = EFFECTS[name].parameters
    full = {k: p.value if p.typical is None else p.typical for k, p in table.items()}
    return SimpleNamespace(**{**full, **values})


def head(x=0.0, y=0.0, heading=0.0, u=0.0, v=0.0, w=0.0):
    return BodyMotion("head", x, y, np.cos(heading), np.sin(heading), u, v, w, 0.2, 1.5, 3e-3)


def wrench(name, body, z=None, drive=STILL, **values):
    z = SimpleNamespace(**dict(z or {}))
    return np.array(EFFECTS[name].wrench(namespace(name, **values), body, z, drive, NUMPY))


def swim(robot, commands, pose=(0.0, 0.0, 0.0), scheme=None):
    stepper = Stepper(robot.structure, scheme, compiled=False)
    return stepper.rollout(stepper.rest(pose), commands, stepper.parameters(robot))


def servo(name, commands, **values):
    """What the rudder effect `name` makes of commands given every 10 ms."""
    effect, p = EFFECTS[name], namespace(name, **values)
    memory, out = SimpleNamespace(**dict.fromkeys(effect.memory, 0.0)), []
    rudder = effect.linkage if effect.has_linkage else effect.rudder
    method = effect.rotor if name.startswith(("rotor", "battery")) else rudder
    for command in commands:
        value, kept = method(p, memory, command, 0.01, NUMPY)
        assert set(kept) == set(effect.memory)
        memory = SimpleNamespace(**kept)
        out.append(float(value))
    return np.array(out)


# drag and walls


def test_quadratic_drag_stops_a_gliding_head_like_the_closed_form():
    """m u' = -k u^2 from u_0: u = u_0 / (1 + k u_0 t / m), all bodies together, tail straight behind."""
    zero = [k for k in Robot().parameters if "_drag_" in k]
    robot = (
        Robot().with_parameters(**dict.fromkeys(zero, 0.0)).with_effect("quadratic_drag", surge=0.6)
    )
    stepper = Stepper(robot.structure, compiled=False)
    start = stepper.rest()
    start[6] = 0.4
    u = stepper.rollout(start, np.zeros((100, 2)), stepper.parameters(robot))[:, 6]
    mass = 0.465 + 0.05 + 0.05 + 0.02  # head, its added mass in surge, links, fin
    np.testing.assert_allclose(u, 0.4 / (1 + 0.6 * 0.4 * 0.01 * np.arange(101) / mass), rtol=1e-9)


def test_quadratic_drag_opposes_every_motion_with_its_square():
    got = wrench("quadratic_drag", head(u=0.3, v=-0.2, w=2.0), surge=0.6, sway=4.0, yaw=1.2e-3)
    np.testing.assert_allclose(got, (-0.6 * 0.09, 4.0 * 0.04, -1.2e-3 * 4.0))
    back = wrench("quadratic_drag", head(u=-0.3, v=0.2, w=-2.0), surge=0.6, sway=4.0, yaw=1.2e-3)
    np.testing.assert_allclose(back, -got)


def test_wall_effect_is_drag_times_1_plus_k_exp_of_distance():
    d = 0.3
    body = head(x=pool.LENGTH / 2 - d, u=0.2, v=-0.1, w=0.5)
    grown = 2.5 * np.exp(-d / 0.2)
    expected = -grown * np.array([0.2 * 0.2, 1.5 * -0.1, 3e-3 * 0.5])
    np.testing.assert_allclose(wrench("wall_effect", body, k=2.5, length=0.2), expected, rtol=1e-12)
    nearer = head(x=1.0, y=-pool.WIDTH / 2 + d, u=0.2, v=-0.1, w=0.5)
    np.testing.assert_allclose(
        wrench("wall_effect", nearer, k=2.5, length=0.2), expected, rtol=1e-12
    )


def test_dry_friction_has_one_size_in_every_direction():
    for u, v in ((0.1, 0.0), (0.0, -0.3), (-0.2, 0.2)):
        X, Y, N = wrench("dry_friction", head(u=u, v=v), force=0.02, moment=0.001)
        assert np.hypot(X, Y) == pytest.approx(0.02, rel=1e-6)
        assert N == 0.0
        assert X * u + Y * v == pytest.approx(-0.02 * np.hypot(u, v), rel=1e-6)
    for w in (0.5, -3.0):
        assert wrench("dry_friction", head(w=w), moment=0.001) == pytest.approx(
            [0.0, 0.0, -1e-3 * np.sign(w)]
        )
    assert not wrench("dry_friction", head()).any()
    slow = wrench("dry_friction", head(u=0.003, v=-0.004, w=0.05), force=0.02, moment=0.001)
    np.testing.assert_allclose(slow, np.tanh(1.0) * np.array([-0.012, 0.016, -0.001]), rtol=1e-5)


def test_wave_drag_is_largest_at_the_hump_and_brakes_both_ways():
    speeds = np.linspace(0.02, 0.5, 200)
    force = np.array([wrench("wave_drag", head(u=u), speed=0.22)[0] for u in speeds])
    assert speeds[force.argmin()] == pytest.approx(0.22, abs=0.003)
    assert wrench("wave_drag", head(u=-0.22), speed=0.22)[0] == pytest.approx(
        -force.min(), rel=1e-4
    )
    hump = {"amplitude": 0.02, "speed": 0.22, "width": 0.04}
    for u, share in ((0.22, 1.0), (0.26, np.exp(-0.5)), (0.14, np.exp(-2.0))):
        assert wrench("wave_drag", head(u=u), **hump) == pytest.approx(
            [-0.02 * share, 0.0, 0.0], rel=1e-6
        )
    slow = wrench("wave_drag", head(u=0.01), amplitude=0.02, speed=0.02, width=0.5)[0]
    assert slow == pytest.approx(-0.02 * np.tanh(1.0), rel=1e-3)


def test_hull_asymmetry_keeps_its_sign_and_grows_with_the_square():
    once, twice = (wrench("hull_asymmetry", head(u=u), sway=0.1, yaw=0.02) for u in (0.1, 0.2))
    np.testing.assert_allclose(twice, 4 * once)
    np.testing.assert_allclose(wrench("hull_asymmetry", head(u=-0.1), sway=0.1, yaw=0.02), -once)
    np.testing.assert_allclose(once, (0.0, 0.1 * 0.01, 0.02 * 0.01))


def test_sloshing_pushes_along_the_pool_whatever_the_heading():
    z = {"phase": 0.7}
    expected = (0.02 * np.sin(0.7) + 0.01 * np.cos(0.7)) * np.cos(np.pi * 0.5 / pool.LENGTH)
    for heading in (0.0, 1.0, 2.5):
        X, Y, N = wrench("sloshing", head(x=0.5, heading=heading), z, sine=0.02, cosine=0.01)
        cos, sin = np.cos(heading), np.sin(heading)
        np.testing.assert_allclose(
            [X * cos - Y * sin, X * sin + Y * cos, N], [expected, 0, 0], atol=1e-15
        )
    end = head(x=pool.LENGTH / 2)
    np.testing.assert_allclose(wrench("sloshing", end, z, sine=0.02, cosine=0.01), 0, atol=1e-15)


def test_tether_is_slack_inside_its_length_and_pulls_to_the_anchor_outside():
    line = {"stiffness": 2.0, "length": 0.5, "x": 1.0, "y": 0.0}
    assert not wrench("tether", head(x=0.6), **line).any()
    np.testing.assert_allclose(wrench("tether", head(x=0.0), **line), [2.0 * 0.5, 0, 0], rtol=1e-9)
    aside = wrench("tether", head(x=1.0, y=0.8), **line)
    np.testing.assert_allclose(aside, [0, -2.0 * 0.3, 0], atol=1e-9)
    half_taut = wrench(
        "tether", head(x=0.5), **line
    )  # w / 4 = 2.5 mm of stretch at its very length
    np.testing.assert_allclose(half_taut, [2.0 * 2.5e-3, 0, 0], rtol=1e-6)
    np.testing.assert_allclose(
        wrench("tether", head(x=0.0, heading=np.pi / 2), **line), [0, -1.0, 0], atol=1e-9
    )


# water


def test_a_uniform_current_is_a_change_of_frame(strokes):
    """Moving with the water from the start, the fish swims as in still water."""
    commands = strokes(60)
    robot = Robot().with_effect("current", x=0.03, y=-0.02)
    stepper = Stepper(robot.structure, compiled=False)
    start = stepper.rest()
    start[6:8] = 0.03, -0.02
    carried = stepper.rollout(start, commands, stepper.parameters(robot))
    still = swim(Robot(), commands)
    time = 0.01 * np.arange(61)
    np.testing.assert_allclose(carried[:, 0], still[:, 0] + 0.03 * time, atol=1e-11)
    np.testing.assert_allclose(carried[:, 1], still[:, 1] - 0.02 * time, atol=1e-11)
    np.testing.assert_allclose(carried[:, 2:6], still[:, 2:6], atol=1e-10)


def test_a_fish_at_rest_ends_drifting_with_the_current():
    robot = Robot(links=1).with_effect("current", x=0.03, y=-0.02)
    last = swim(robot, np.zeros((1500, 2)), scheme=Scheme("rk4"))[-1]
    np.testing.assert_allclose(last[4:6], [0.03, -0.02], rtol=0.01)


def test_nonuniform_current_is_incompressible_closed_beyond_the_walls_and_has_its_own_gradient():
    p, z = namespace("nonuniform_current"), SimpleNamespace()
    flow = EFFECTS["nonuniform_current"].water
    h = 1e-6
    for x, y in np.random.default_rng(0).uniform(-1, 1, (20, 2)):
        _, gradient = flow(p, x, y, z, NUMPY)
        dx = (np.array(flow(p, x + h, y, z, NUMPY)[0]) - flow(p, x - h, y, z, NUMPY)[0]) / (2 * h)
        dy = (np.array(flow(p, x, y + h, z, NUMPY)[0]) - flow(p, x, y - h, z, NUMPY)[0]) / (2 * h)
        np.testing.assert_allclose(np.array(gradient), np.stack([dx, dy], 1), atol=1e-9)
        assert gradient[0][0] + gradient[1][1] == pytest.approx(0.0, abs=1e-15)
    gyres = namespace("nonuniform_current", strain=0.0, shear_x=0.0, shear_y=0.0)
    for s in (-0.4, 0.0, 0.3):
        assert flow(gyres, BASIN_LENGTH / 2, s, z, NUMPY)[0][0] == pytest.approx(0.0, abs=1e-15)
        assert flow(gyres, s, BASIN_WIDTH / 2, z, NUMPY)[0][1] == pytest.approx(0.0, abs=1e-15)
    others = {key: 0.0 for key in vars(gyres) if key != "gyre_11"}
    one = namespace("nonuniform_current", **others)
    assert flow(one, 0.0, -BASIN_WIDTH / 2, z, NUMPY)[0][0] == pytest.approx(
        0.03
    )  # counter-clockwise


def test_nonuniform_current_is_a_linear_part_and_the_eddies_of_its_stream_function():
    """V = (d psi/dy, -d psi/dx) with psi = sum (W / n pi) g_mn sin(m pi a) sin(n pi b), every part of its own size."""
    random = np.random.default_rng(4)
    p = namespace("nonuniform_current")
    p = SimpleNamespace(**{key: random.uniform(-0.1, 0.1) for key in vars(p)})
    L, W, h = BASIN_LENGTH, BASIN_WIDTH, 1e-5

    def psi(x, y):
        a, b = x / L + 0.5, y / W + 0.5
        return sum(
            W
            / (n * np.pi)
            * getattr(p, f"gyre_{m}{n}")
            * np.sin(m * np.pi * a)
            * np.sin(n * np.pi * b)
            for m in range(1, 9)
            for n in range(1, 5)
        )

    for x, y in random.uniform(-1, 1, (10, 2)):
        V, _ = EFFECTS["nonuniform_current"].water(p, x, y, SimpleNamespace(), NUMPY)
        eddies = (
            (psi(x, y + h) - psi(x, y - h)) / (2 * h),
            -(psi(x + h, y) - psi(x - h, y)) / (2 * h),
        )
        linear = p.mean_x + p.strain * x + p.shear_x * y, p.mean_y + p.shear_y * x - p.strain * y
        np.testing.assert_allclose(V, np.add(linear, eddies), atol=1e-9)


@pytest.mark.parametrize(("core", "most"), [(0.36, 0.18), (0.45, 0.06), (0.74, 0.12)])
def test_nonuniform_current_resolves_an_eddy_wherever_it_is(core, most):
    """Taylor vortices (Saffman 1992, ch. 13) by least squares over the pool.

    Four by three gyres left half of one of 0.36 m, and gyres that close at the walls 22 % of one of 0.74 m.
    """
    effect, rest = EFFECTS["nonuniform_current"], SimpleNamespace()
    x, y = np.meshgrid(
        np.linspace(-0.45, 0.45, 40) * pool.LENGTH,
        np.linspace(-0.4, 0.4, 20) * pool.WIDTH,
        indexing="ij",
    )

    def part(key):
        p = SimpleNamespace(**{other: float(other == key) for other in effect.parameters})
        return np.ravel(
            [velocity + np.zeros_like(x) for velocity in effect.water(p, x, y, rest, np)[0]]
        )

    parts = np.stack([part(key) for key in effect.parameters], axis=1)
    for at_x, at_y in ((-0.28, 0.24), (0.6, 0.4), (0.0, 0.0)):
        dx, dy = x - at_x, y - at_y
        eddy = np.ravel([-dy, dx] * np.exp(0.5 - 0.5 * (dx**2 + dy**2) / core**2))
        left = eddy - parts @ np.linalg.lstsq(parts, eddy, rcond=None)[0]
        assert np.linalg.norm(left) < most * np.linalg.norm(eddy)


# tail


def test_a_firm_grip_is_the_no_slip_constraint_and_a_loose_one_slips(strokes):
    commands = strokes(50)
    nominal = swim(Robot(), commands)
    gaps = [
        np.abs(
            swim(Robot().with_effect("tip_slip", mobility=m), commands)[:, :6] - nominal[:, :6]
        ).max()
        for m in (1e-6, 1e-3, 1.0 / 6.0)
    ]
    assert gaps[0] < 1e-5 < gaps[1] < gaps[2]


def test_tip_force_of_a_finite_grip_is_minus_grip_times_slip():
    """Above mobility A / SLIP_DECAY, A about 14 1/kg, the law is explicit."""
    robot = Robot().with_effect("tip_slip", mobility=1.0)
    stepper = Stepper(robot.structure, compiled=False)
    state = stepper.rest()
    state[6:12] = (0.1, 0.05, 0.3, 0.2, -0.4, 0.6)
    out = stepper.outputs(state, np.zeros(2), stepper.parameters(robot))
    assert out["tip_force"] == pytest.approx(-out["slip"] / 1.0, rel=1e-6)
    assert EFFECTS["tip_slip"].derived(namespace("tip_slip"))["grip"] == (
        pytest.approx(6.0),
        "N s/m",
    )


def test_wake_memory_without_share_is_tip_slip(strokes):
    commands = strokes(60)
    plain = swim(Robot().with_effect("tip_slip", mobility=0.125), commands)
    wake = swim(Robot().with_effect("wake_memory", mobility=0.125, share=0.0), commands)
    np.testing.assert_allclose(wake[:, :12], plain[:, :12], atol=1e-11)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_tip_force_with_a_memory_is_that_of_the_slip_now_and_of_the_slip_as_it_was(share):
    """The law of the docstring, and a wake that has settled leaves the grip of `tip_slip`, whatever its share."""
    robot = Robot().with_effect("wake_memory", mobility=1.0, share=share)
    stepper = Stepper(robot.structure, compiled=False)
    state = stepper.rest()
    state[6:12] = (0.1, 0.05, 0.3, 0.2, -0.4, 0.6)
    slip = float(stepper.outputs(state, np.zeros(2), stepper.parameters(robot))["slip"])
    for wake in (-2.0 * slip, 0.0, slip):
        state[stepper.layout.state.index("wake_memory.wake")] = wake
        out = stepper.outputs(state, np.zeros(2), stepper.parameters(robot))
        assert out["tip_force"] == pytest.approx(
            -((1.0 - share) * slip + share * wake) / 1.0, rel=1e-6
        )
    assert out["tip_force"] == pytest.approx(-slip, rel=1e-6)


def test_states_of_effects_follow_their_equations(strokes):
    """A phase that turns at its frequency, an angle that sums up the speed, a wake that lags behind the slip."""
    robot = Robot(links=1).with_effect("sloshing", sine=0.02, frequency=0.7)
    robot = robot.with_effect("rotor_imbalance", ahead=6e-5)
    robot = robot.with_effect("wake_memory", mobility=0.125, share=0.5, time_constant=0.2)
    stepper, commands = Stepper(robot.structure, compiled=False), strokes(150)
    p = stepper.parameters(robot)
    states = stepper.rollout(stepper.rest(), commands, p)
    of = dict(zip(stepper.layout.state, states.T, strict=True))
    time = 0.01 * np.arange(151)
    np.testing.assert_allclose(of["sloshing.phase"], 2 * np.pi * 0.7 * time, atol=1e-9)
    speed = of["rotor_speed"]
    turned = np.concatenate([[0.0], np.cumsum(0.005 * (speed[1:] + speed[:-1]))])
    np.testing.assert_allclose(of["rotor_imbalance.angle"], turned, atol=1e-9)
    slip = stepper.outputs(states, np.zeros(2), p)["slip"]
    _, late, _ = lsim(([1.0], [0.2, 1.0]), slip, time)
    assert np.ptp(late) > 0.01
    np.testing.assert_allclose(of["wake_memory.wake"], late, atol=0.01 * np.ptp(late))


def test_tail_hardening_and_damping_are_torques_of_the_joint():
    hardening = EFFECTS["tail_hardening"].joint_torque
    assert hardening(namespace("tail_hardening", k3=0.3), 1, -0.5, 9.0, NUMPY) == pytest.approx(
        -0.0375
    )
    damping = EFFECTS["tail_joint_damping"].joint_torque
    assert damping(namespace("tail_joint_damping", c=1e-3), 2, 9.0, -2.0, NUMPY) == pytest.approx(
        -2e-3
    )


# mass and rotor


def test_a_payload_at_the_centre_is_a_heavier_head(strokes):
    commands = strokes(60)
    loaded = swim(Robot().with_effect("payload", mass=0.1, forward=0.0, left=0.0), commands)
    np.testing.assert_allclose(
        loaded, swim(Robot().with_parameters(head_mass=0.565), commands), atol=1e-10
    )


@pytest.mark.parametrize(("X", "Y"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.3)])
def test_a_payload_off_centre_makes_one_rigid_body_with_the_head(X, Y):
    """A free head of 0.465 kg, without added mass, pushed at its own centre of mass c and braked by its rotor.

    a = F / m + r' (y_c, -x_c),   r' = (M + y_c X - x_c Y) / I,   (x_c, y_c): centre of both, seen from c
    """
    light = dict.fromkeys(("link_mass", "fin_mass"), 1e-9)
    light |= dict.fromkeys(("link_added_mass_sway", "fin_added_mass_sway", "tail_stiffness"), 0.0)
    light |= {k: 0.0 for k in Robot().parameters if "_drag_" in k}
    light |= {"head_added_mass_surge": 0.0, "head_added_mass_sway": 0.0}
    robot = Robot().with_parameters(**light).with_effect("disturbance", surge=X, sway=Y, yaw=0.02)
    loaded = robot.with_effect("payload", mass=0.1, forward=0.03, left=0.04)
    stepper = Stepper(loaded.structure, compiled=False)
    rates = np.array([0.0, -800.0])  # the rotor brakes: with the 0.02 N m above a moment of 0.1 N m
    out = stepper.outputs(stepper.rest(), rates, stepper.parameters(loaded))
    x_c, y_c = 0.1 / 0.565 * np.array([0.03, 0.04])
    turn = (0.1 + y_c * X - x_c * Y) / (2.4e-3 + 0.05**2 * 0.1 * 0.465 / 0.565)
    expected = (X / 0.565 + turn * y_c, Y / 0.565 - turn * x_c, turn)
    np.testing.assert_allclose(out["acceleration"][:3], expected, rtol=1e-4)


def test_rotor_imbalance_is_the_reaction_of_a_mass_on_a_circle():
    """-m d2/dt2 of the mass's place on a rotor that turns at phi(t) on a head that turns at rate r."""
    m_e, at, r, t, h = 6e-5, 0.5, 0.8, 0.3, 1e-4  # at: where the mass is on the rotor
    phi = lambda t: 3.0 + 20.0 * t + 40.0 * t**2  # noqa: E731
    place = lambda t: m_e * np.array([np.cos(at + phi(t) + r * t), np.sin(at + phi(t) + r * t)])  # noqa: E731
    reaction = -(place(t + h) - 2 * place(t) + place(t - h)) / h**2
    cos, sin = np.cos(r * t), np.sin(r * t)
    expected = np.array([[cos, sin], [-sin, cos]]) @ reaction
    drive = Drive(0.0, 0.0, 20.0 + 80.0 * t, 80.0)
    mass = {"ahead": m_e * np.cos(at), "left": m_e * np.sin(at)}
    got = wrench("rotor_imbalance", head(w=r), {"angle": phi(t)}, drive, **mass)
    np.testing.assert_allclose(got[:2], expected, rtol=1e-5, atol=1e-6)


def test_rotor_lag_is_the_exact_answer_to_a_speed_that_is_linear_between_commands():
    time = 0.01 * np.arange(200)
    commands = 100 * np.sin(4 * np.pi * time)
    _, expected, _ = lsim(([1.0], [0.03, 1.0]), commands, time, interp=True)
    np.testing.assert_allclose(
        servo("rotor_lag", commands, time_constant=0.03), expected, atol=1e-9
    )


def test_rotor_saturation_clips():
    np.testing.assert_array_equal(
        servo("rotor_saturation", [50, 90, -90], limit=70.0), [50, 70, -70]
    )


@pytest.mark.parametrize("command", [70.0, -70.0])
def test_battery_sag_slows_the_rotor_as_its_load_builds_up(command):
    """load = (70 / 100)^2 (1 - exp(-t / T)) from rest; a load that takes all leaves the rotor standing."""
    speeds = servo("battery_sag", np.full(300, command), sag=0.4, time_constant=0.5)
    load = 0.7**2 * (1 - np.exp(-0.01 * np.arange(1, 301) / 0.5))
    np.testing.assert_allclose(speeds, command * (1 - 0.4 * load), rtol=1e-12)
    assert servo("battery_sag", np.full(300, 2 * command), sag=2.0, time_constant=0.5)[-1] == 0.0


# rudder


def test_rudder_lag_answers_a_step_exponentially_or_at_the_rate_limit():
    lag = Robot(links=1).with_effect("rudder_lag", time_constant=0.12)
    commands = np.tile([0.0, 0.4], (60, 1))
    time = 0.01 * np.arange(61)
    fast = swim(lag.with_parameters(servo_rate_limit=1e3), commands)[:, 8]
    np.testing.assert_allclose(fast, 0.4 * (1 - np.exp(-time / 0.12)), rtol=1e-12, atol=1e-15)
    slow = swim(lag.with_parameters(servo_rate_limit=1.0), commands)[:, 8]
    # at the limit until what is left asks for less: 0.4 - alpha = rate * reach, reach = dt / (1 - exp(-dt / T))
    reach = 0.01 / (1 - np.exp(-0.01 / 0.12))
    limited = slow < 0.4 - reach
    np.testing.assert_allclose(slow[limited], time[limited], atol=1e-12)
    assert 25 < limited.sum() < 35
    assert slow[-1] < 0.4


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.085, 0.3])
def test_rudder_delay_shifts_and_interpolates(delay):
    commands = np.random.default_rng(0).normal(size=80)
    past = np.concatenate([np.zeros(40), commands])
    expected = np.interp(np.arange(40, 120) - delay / 0.01, np.arange(120), past)
    np.testing.assert_allclose(servo("rudder_delay", commands, delay=delay), expected, atol=1e-12)


def test_rudder_backlash_is_a_play_operator():
    commands = [0.0, 0.05, 0.2, 0.15, 0.1, -0.1, -0.05]
    answer = servo("rudder_backlash", commands, play=0.06)
    np.testing.assert_allclose(answer, [0, 0, 0.14, 0.14, 0.14, -0.04, -0.04], atol=1e-15)


def test_rudder_offset_gain_and_saturation():
    np.testing.assert_allclose(servo("rudder_offset", [0.1, -0.1], offset=0.06), [0.16, -0.04])
    np.testing.assert_allclose(servo("rudder_gain", [0.1, -0.1], factor=0.8), [0.08, -0.08])
    np.testing.assert_allclose(servo("rudder_saturation", [0.3, -0.1], limit=0.25), [0.25, -0.1])


def test_rudder_effects_act_in_the_order_of_their_table():
    order = [n for n in EFFECTS if n.startswith("rudder_")]
    names = ("gain", "offset", "saturation", "delay", "backlash", "lag", "placement")
    assert order == [f"rudder_{n}" for n in names]
    robot = Robot().with_effect("rudder_offset", offset=0.1).with_effect("rudder_gain", factor=0.5)
    states = swim(robot, np.tile([0.0, 0.4], (40, 1)))
    assert states[-1, 12] == pytest.approx(0.5 * 0.4 + 0.1)
    assert states[-1, 14] == pytest.approx(0.4)  # the servo's own position


def test_a_linkage_sits_behind_the_servo_and_its_range():
    robot = (
        Robot().with_effect("rudder_offset", offset=0.1).with_effect("rudder_backlash", play=0.05)
    )
    states = swim(robot, np.tile([0.0, 2.0], (40, 1)))
    assert states[-1, 14] == pytest.approx(0.8)  # the command's range
    assert states[-1, 12] == pytest.approx(0.8 + 0.1 - 0.05)
    stepper = Stepper.of(robot)
    rest = stepper.rest(parameters=stepper.parameters(robot))
    assert rest[12] == pytest.approx(0.1 - 0.05)  # offset, and dragged there against the play


def test_left_rudder_turns_left_and_so_does_a_positive_offset(strokes):
    commands = strokes(200) * [1.0, 0.0]
    straight = swim(Robot(), commands, scheme=Scheme("rk4"))[-1, 2]
    left = swim(Robot(), commands + [0.0, 0.3], scheme=Scheme("rk4"))[-1, 2]
    offset = swim(Robot().with_effect("rudder_offset", offset=0.3), commands, scheme=Scheme("rk4"))[
        -1, 2
    ]
    assert left > straight + 0.2
    assert offset == pytest.approx(left, abs=5e-3)  # but for the servo's way there, 0.05 s


NEAR_WALL = (0.3, 0.85, 0.1)
MOTION = 8  # q and q' of a fish with one link
PHYSICS = (
    "quadratic_drag current nonuniform_current wall_effect tip_slip wake_memory wave_drag sloshing "
    "hull_asymmetry tail_hardening tail_joint_damping dry_friction tether payload rotor_imbalance"
).split()
ACTUATORS = (
    "rudder_lag rudder_delay rudder_backlash rudder_offset rudder_saturation rudder_gain rudder_placement "
    "rotor_lag rotor_saturation battery_sag"
).split()


def typical(name):
    return {
        key: p.typical if p.typical is not None else p.value
        for key, p in EFFECTS[name].parameters.items()
    }


def strongest(name):
    """Every parameter at the upper end of its range, where it has one."""
    effect = EFFECTS[name]
    return {
        k: p.highest if np.isfinite(p.highest) else typical(name)[k]
        for k, p in effect.parameters.items()
    }


def swim_with(effects, commands, poses=NEAR_WALL, links=1):
    """States of a fish with effects {name: parameters}, without a compiler; (T + 1, ..., NS)."""
    robot = Robot(links=links, effects=effects)
    stepper = Stepper(robot.structure, stable_scheme(robot), compiled=False)
    start = (
        np.stack([stepper.rest(pose) for pose in poses])
        if np.ndim(poses) == 2
        else stepper.rest(poses)
    )
    return stepper.rollout(start, commands, stepper.parameters(robot))


def test_every_physics_and_actuator_name_of_the_vocabulary_exists():
    assert {n: EFFECTS[n].kind for n in PHYSICS} == dict.fromkeys(PHYSICS, "physics")
    assert [effect.name for effect in EFFECTS.values()] == list(EFFECTS)
    assert {n: EFFECTS[n].kind for n in ACTUATORS} == dict.fromkeys(ACTUATORS, "actuator")


@pytest.mark.parametrize("name", EFFECTS)
def test_description_is_complete(name):
    effect = EFFECTS[name]
    assert effect.name == name
    assert effect.equation
    assert effect.source
    assert effect.__doc__
    assert effect.strength
    assert set(effect.strength) <= set(effect.parameters)
    for key, p in effect.parameters.items():
        assert p.lowest <= p.value <= p.highest and p.unit and p.source, key
        assert (p.typical is not None) == (key in effect.strength), key
        assert p.typical is None or (p.lowest <= p.typical <= p.highest and p.typical != p.value), (
            key
        )
        assert all(p.lowest <= tried <= p.highest for tried in p.tries), key


@pytest.mark.parametrize("name", EFFECTS)
def test_zero_strength_is_the_nominal_model(name, strokes):
    nominal, neutral = swim_with({}, strokes(60)), swim_with({name: {}}, strokes(60))
    np.testing.assert_allclose(neutral[:, :MOTION], nominal[:, :MOTION], rtol=0, atol=1e-11)


def test_all_effects_together_at_zero_strength_are_the_nominal_model(strokes):
    off = {name: {} for name in EFFECTS}
    nominal, neutral = swim_with({}, strokes(60), links=3), swim_with(off, strokes(60), links=3)
    np.testing.assert_allclose(neutral[..., :12], nominal[..., :12], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", EFFECTS)
def test_typical_strength_changes_the_motion_and_stays_finite(name, strokes):
    nominal, changed = swim_with({}, strokes(80)), swim_with({name: typical(name)}, strokes(80))
    assert np.isfinite(changed).all()
    assert np.abs(changed[-1, :MOTION] - nominal[-1, :MOTION]).max() > 1e-5


def test_all_effects_together_stay_finite(strokes):
    states = swim_with({name: typical(name) for name in EFFECTS}, strokes(80), links=3)
    assert np.isfinite(states).all()


@pytest.mark.parametrize(
    ("name", "links"),
    [*((name, 1) for name in EFFECTS), ("tail_hardening", 3), ("tail_joint_damping", 3)],
)
def test_the_upper_end_of_the_ranges_stays_finite(name, links, strokes):
    commands = strokes(100) * [12 / 9, 1.6]  # full throttle, rudder from end to end
    assert np.isfinite(swim_with({name: strongest(name)}, commands, (0.0, 0.0, 0.3), links)).all()


@pytest.mark.parametrize("name", EFFECTS)
def test_a_batch_equals_its_elements(name, strokes):
    poses = [NEAR_WALL, (-1.0, -0.2, 2.0), (2.0, 0.0, -1.0)]
    commands = strokes(15)
    batch = swim_with({name: typical(name)}, commands, poses)
    for i, pose in enumerate(poses):
        np.testing.assert_allclose(
            batch[:, i], swim_with({name: typical(name)}, commands, pose), atol=1e-12
        )


@pytest.mark.parametrize("name", EFFECTS)
def test_wrenches_act_on_the_head_and_only_those_of_the_walls_on_the_tail_too(name):
    effect, p = EFFECTS[name], SimpleNamespace(**typical(name))
    z = SimpleNamespace(**dict.fromkeys(effect.states, 0.3))
    for body in ("link_1", "fin"):
        motion = BodyMotion(body, 0.3, 0.85, 0.8, 0.6, 0.2, -0.1, 0.5, 0.2, 1.5, 3e-3)
        force = effect.wrench(p, motion, z, Drive(0.1, 0.2, 50.0, -300.0), NUMPY) or (0.0, 0.0, 0.0)
        assert any(force) == (name == "wall_effect")


@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if e.dissipative])
def test_dissipative_effects_never_give_energy_to_the_fish(name):
    random = np.random.default_rng(0)
    effect, p = EFFECTS[name], SimpleNamespace(**typical(name))
    z = SimpleNamespace(**dict.fromkeys(effect.states, 0.0))
    drive = Drive(0.1, 0.2, 50.0, -300.0)
    lost = 0.0
    for x, y, u, v, w, heading in random.uniform(-1, 1, (200, 6)):
        body = BodyMotion("head", x, y, np.cos(heading), np.sin(heading), u, v, w, 0.2, 1.5, 3e-3)
        force = effect.wrench(p, body, z, drive, NUMPY) or (0.0, 0.0, 0.0)
        power = (
            force[0] * u + force[1] * v + force[2] * w - effect.joint_torque(p, 1, x, w, NUMPY) * w
        )
        assert power <= 0.0
        lost -= power
    assert lost > 0.0


def test_states_and_memory_start_at_rest_and_parameters_are_named_once():
    structure = (3, tuple(EFFECTS.values()))
    stepper = Stepper(structure, compiled=False)
    assert not stepper.rest()[3:].any()
    assert len(set(stepper.layout.state)) == len(stepper.layout.state)
    assert len(set(parameter_names(structure))) == len(parameter_names(structure))


PAGE = Path(__file__).parent.parent / "docs" / "adding_an_effect.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.fixture
def table():
    before = dict(EFFECTS)
    yield EFFECTS
    EFFECTS.clear()
    EFFECTS.update(before)


def test_the_example_works_and_says_what_it_does(table, capsys, tmp_path):
    effect_file, table_line, use = blocks("python")
    names = {"EFFECTS": table}
    exec(compile(effect_file, "drag_arm.py", "exec"), names)
    exec(table_line, names)
    exec(use, names)
    headings = re.findall(r"heading (-?[\d.]+) rad", capsys.readouterr().out)
    assert len(headings) == 2
    assert headings[0] != headings[1]
    robot = tmp_path / "robot.yaml"
    robot.write_text(yaml.safe_dump({"format": 1, **yaml.safe_load(blocks("yaml")[0])}))
    assert load_robot(robot) == Robot().with_effect("drag_arm", arm=0.02)


@pytest.mark.parametrize("water", [WaterPush.usual(2.0), WaterPush.of_force(0.002)])
def test_the_push_is_stationary_and_correlated_over_its_time(water: WaterPush) -> None:
    random = np.random.default_rng(0)
    first = water.first(random.standard_normal((4000, 3)))
    push = first
    for _ in range(round(water.time / DT)):
        push = water.after(push, random.standard_normal(push.shape))
    for wrench in (first, push):
        np.testing.assert_allclose(wrench.std(axis=0), water.size, rtol=0.05)
    correlation = (first * push).mean(axis=0) / (first.std(axis=0) * push.std(axis=0))
    np.testing.assert_allclose(correlation, np.exp(-1.0), atol=0.05)


def test_still_water_does_not_push() -> None:
    water = WaterPush.of_force(0.0)
    assert not water.after(water.first(np.ones(3)), np.ones(3)).any()


def test_without_fresh_numbers_the_push_decays_exponentially() -> None:
    water = WaterPush.usual()
    push = np.array([1.0, -2.0, 0.5])
    for _ in range(40):
        push = water.after(push, np.zeros(3))
    np.testing.assert_allclose(push, np.exp(-40 * DT / water.time) * np.array([1.0, -2.0, 0.5]))


EXACT = {
    "gyro_noise": 0.0,
    "gyro_bias": 0.0,
    "accelerometer_noise": 0.0,
    "accelerometer_bias": 0.0,
    "disturbance": 0.0,
}
# where a fish that swims straight comes to a wall within two seconds: a wall's normal is x or y
TOWARDS = {
    "east": ({"start_x": LENGTH / 2 - 0.1}, 0),
    "north": ({"start_y": WIDTH / 2 - 0.1, "start_heading": 0.5 * math.pi}, 1),
    "west": ({"start_x": 0.1 - LENGTH / 2, "start_heading": math.pi}, 0),
}


def swim_at_walls(simulation: Simulation, seconds: float) -> list[Readings]:
    readings = []
    for _ in range(round(seconds / DT)):
        simulation.command(110.0 * math.sin(4.0 * math.pi * (simulation.time + DT)), 0.0)
        readings.append(simulation.advance())
    return readings


def columns(readings: list[Readings]) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 2) [m] and velocities (N, 2) [m/s], pool frame."""
    pose, velocity = (
        np.array([getattr(r.truth, key) for r in readings]) for key in ("pose", "velocity")
    )
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    u, v = velocity[:, :2].T
    return pose[:, :2], np.column_stack([cos * u - sin * v, sin * u + cos * v])


@pytest.mark.parametrize(("start", "normal"), TOWARDS.values(), ids=TOWARDS)
def test_a_fish_that_swims_against_a_wall_stops_there(start, normal):
    simulation = Simulation(Robot(), SimulationConfig(**EXACT, **start))
    readings = swim_at_walls(simulation, 6.0)
    place, velocity = columns(readings)
    assert np.abs(place[:, normal]).max() == EDGE[normal]
    at_wall = np.abs(place[:, normal]) == EDGE[normal]
    assert at_wall.sum() > 100
    assert (velocity[at_wall, normal] * place[at_wall, normal]).max() < 1e-9  # never outward
    assert np.abs(velocity).max() < 1.0
    assert simulation.walls.contacts == 1
    assert np.abs(simulation.walls.place[normal]) == EDGE[normal]


@pytest.mark.parametrize(("start", "normal"), TOWARDS.values(), ids=TOWARDS)
def test_the_accelerometer_feels_how_the_velocity_changes_at_the_wall(start, normal):
    """Summed over the contact it is the change of velocity along the normal: neither a push nor an impact is left out."""
    readings = swim_at_walls(Simulation(Robot(), SimulationConfig(**EXACT, **start)), 6.0)
    place, velocity = columns(readings)
    heading = np.array([r.truth.pose[2] for r in readings])
    felt = np.array([r.imu.specific_force[:2] for r in readings])
    cos, sin = np.cos(heading), np.sin(heading)
    pool = np.column_stack(
        [cos * felt[:, 0] - sin * felt[:, 1], sin * felt[:, 0] + cos * felt[:, 1]]
    )
    at_wall = np.flatnonzero(np.abs(place[:, normal]) == EDGE[normal])
    change = (velocity[at_wall] - velocity[at_wall - 1])[:, normal] / DT
    np.testing.assert_allclose(pool[at_wall, normal], change, atol=1e-9)
    assert np.abs(pool).max() < 60.0  # m/s^2, a stop from 0.5 m/s within a period is 50


def test_a_fish_that_never_comes_to_a_wall_swims_the_same_to_the_last_bit():
    with_walls, without = (
        swim_at_walls(Simulation(Robot(), SimulationConfig(walls=walls)), 5.0)
        for walls in (True, False)
    )
    for a, b in zip(with_walls, without, strict=True):
        assert a.truth == b.truth
        assert a.rotor == b.rotor
        assert a.camera == b.camera
        assert np.array_equal(a.imu.specific_force, b.imu.specific_force)


def test_without_walls_the_water_has_no_end():
    start, _ = TOWARDS["east"]
    simulation = Simulation(Robot(), SimulationConfig(walls=False, **EXACT, **start))
    place, _ = columns(swim_at_walls(simulation, 6.0))
    assert place[:, 0].max() > EDGE[0] + 0.1
    assert simulation.walls.contacts == 0


def touch(walls: Walls, time: float, x: float) -> tuple[float, float]:
    position, velocity = np.array([x, 0.0]), np.array([0.2, 0.1])
    walls.hold(time, position, velocity)
    return float(position[0]), float(velocity[0])


def test_touches_stroke_after_stroke_are_one_contact():
    walls = Walls()
    for time in (1.0, 1.5, 2.0, 2.0 + 0.9 * APART):
        assert touch(walls, time, EDGE[0] + 1e-3) == (EDGE[0], 0.0)
    assert walls.contacts == 1
    assert touch(walls, 5.0, 2.0) == (2.0, 0.2)
    assert not walls.touches(5.0)
    touch(walls, 5.0 + APART, EDGE[0] + 1e-3)
    assert walls.contacts == 2
    assert walls.place == (EDGE[0], 0.0)
    walls.leave()
    touch(walls, 5.0 + APART, EDGE[0] + 1e-3)
    assert walls.contacts == 3


def test_a_fish_beyond_the_wall_that_comes_back_keeps_its_velocity():
    position, velocity = np.array([0.0, EDGE[1] + 0.01]), np.array([0.1, -0.2])
    assert Walls().hold(0.0, position, velocity).tolist() == [False, True]
    assert position.tolist() == [0.0, EDGE[1]]
    assert velocity.tolist() == [0.1, -0.2]
