# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Equations of motion, their factorisation, integration methods, and one step."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from lagrangian import accelerations, kinetic_energy, momentum, spring_energy
from scipy.integrate import DOP853, solve_ivp
from torch import tensor

from fish_sim import torch_step
from fish_sim.checks import check_finite, diverged
from fish_sim.dynamics import SLIP_DECAY, energy
from fish_sim.effects import EFFECTS
from fish_sim.methods import METHODS
from fish_sim.model import DT, Layout, motion_rate, motion_solution
from fish_sim.ops import NUMPY, back_substitute, factorise, reduce
from fish_sim.robot import Robot
from fish_sim.scheme import (
    Scheme,
    check_scheme,
    default_scheme,
    growth,
    modes_at_rest,
    stable_scheme,
)
from fish_sim.step import Stepper

DRAGS = (
    "head_drag_surge head_drag_sway head_drag_yaw link_drag_surge link_drag_sway fin_drag_surge fin_drag_sway"
).split()


def drag_free(links=3):
    return Robot(links=links).with_parameters(**dict.fromkeys(DRAGS, 0.0))


def random_motion(links, seed):
    random = np.random.default_rng(seed)
    q = np.concatenate(
        [random.uniform(-1, 1, 2), random.uniform(-3, 3) + random.uniform(-0.8, 0.8, links + 1)]
    )
    return q, random.normal(size=links + 3) * 0.5


@pytest.mark.parametrize("links", [1, 2, 3, 5])
@pytest.mark.parametrize("share", [0.0, 0.4])
def test_accelerations_and_tip_force_are_those_of_the_lagrangian(links, share):
    robot = Robot(links=links)
    if share:
        robot = robot.with_effect("rudder_placement", tip_share=share)
    layout = Layout(robot.structure)
    for seed in range(2):
        q, qd = random_motion(links, seed)
        drive = (0.3, -1.7, 60.0, 900.0)
        ours = motion_solution(layout, [*q, *qd], drive, robot.vector(), NUMPY)
        qdd, force = accelerations(q, qd, 0.3, -1.7, 900.0, robot.parameters, share, SLIP_DECAY)
        np.testing.assert_allclose(ours.acceleration, qdd, rtol=1e-9, atol=1e-9 * np.abs(qdd).max())
        assert ours.tip_force == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("links", [1, 3])
def test_energy_is_that_of_the_lagrangian(links):
    r = Robot(links=links).parameters
    q, qd = random_motion(links, 7)
    expected = kinetic_energy(tensor(q), tensor(qd), tensor(0.2), tensor(0.0), r) + spring_energy(
        tensor(q), 0.2, r
    )
    assert energy(q, qd, 0.2, SimpleNamespace(**r), NUMPY) == pytest.approx(
        float(expected), rel=1e-12
    )


@pytest.mark.parametrize(
    ("links", "scheme", "per_second"),
    [(3, None, 5e-7), (3, Scheme("dop853", 2), 5e-8), (1, None, 1e-9)],
)
def test_energy_without_drag_and_drive_is_constant(links, scheme, per_second):
    robot = drag_free(links)
    stepper = Stepper.of(robot, scheme)
    start = stepper.rest(rudder=0.2)
    size = 3 + links
    start[2:size] = (0.1, 0.2, 0.3, 0.5)[: links + 1]
    start[size : size + 2] = (
        0.2 * np.cos(start[size - 1]),
        0.2 * np.sin(start[size - 1]),
    )  # the tip does not slip
    commands = np.tile([0.0, 0.2], (1000, 1))
    states = stepper.rollout(start, commands, stepper.parameters(robot))
    q, qd = states[:, :size].T, states[:, size : 2 * size].T
    E = energy(q, qd, 0.2, SimpleNamespace(**robot.parameters), NUMPY)
    assert np.abs(E[100:] / E[0] - E[:-100] / E[0]).max() < per_second
    assert np.ptp(states[:, size - 1]) > 0.3
    assert E[0] > 0.005


def test_the_tip_does_not_slip_while_swimming(strokes):
    robot = Robot()
    stepper = Stepper.of(robot)
    commands = strokes(500)
    states = stepper.rollout(stepper.rest(), commands, stepper.parameters(robot))
    slip = stepper.outputs(states, np.zeros(2), stepper.parameters(robot))["slip"]
    assert np.abs(slip).max() < 1e-5
    assert np.linalg.norm(states[-1, :2]) > 0.3


def test_momentum_is_conserved_with_the_constraint_off():
    robot = drag_free()
    layout = Layout(robot.structure)
    q, qd = random_motion(3, 11)
    p = robot.vector()

    def rate(_, x):
        return [
            *x[6:],
            *motion_solution(layout, x, (0.3, 0.0, 0.0, 0.0), p, NUMPY, False).acceleration,
        ]

    run = solve_ivp(
        rate, (0.0, 0.15), np.concatenate([q, qd]), method="DOP853", rtol=1e-10, atol=1e-12
    )
    linear, angular = zip(*(momentum(x[:6], x[6:], robot.parameters) for x in run.y.T), strict=True)
    np.testing.assert_allclose(linear, np.tile(linear[0], (len(linear), 1)), rtol=1e-8)
    np.testing.assert_allclose(angular, angular[0], rtol=1e-8)
    assert np.ptp(run.y[5]) > 0.1  # the tail moved meanwhile


def test_rate_of_the_motion_vector_is_velocity_then_acceleration():
    robot = Robot()
    q, qd = random_motion(3, 13)
    drive = (0.1, 0.0, 0.0, 500.0)
    rate = motion_rate(Layout(robot.structure), [*q, *qd], drive, robot.vector(), NUMPY)
    np.testing.assert_array_equal(rate[:6], qd)
    qdd, _ = accelerations(q, qd, 0.1, 0.0, 500.0, robot.parameters, 0.0, SLIP_DECAY)
    np.testing.assert_allclose(rate[6:12], qdd, rtol=1e-9, atol=1e-9 * np.abs(qdd).max())


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_factorisation_solves_as_lapack_does(size: int) -> None:
    rng = np.random.default_rng(size)
    root = rng.normal(size=(size, size))
    M, b = root @ root.T + 0.1 * np.eye(size), rng.normal(size=size)
    L, inverse = factorise(np.tril(M).tolist())
    x = back_substitute(L, inverse, reduce(L, b))
    assert np.allclose(x, np.linalg.solve(M, b), rtol=1e-9)


def test_pivots_are_those_of_cholesky() -> None:
    M = np.array([[4.0, 2.0], [2.0, 5.0]])
    L, inverse = factorise(np.tril(M).tolist())
    assert inverse == [0.25, 0.25]
    assert L[1][0] == 0.5


def test_a_batch_of_matrices_is_factorised_at_once() -> None:
    first, other = np.array([2.0, 3.0]), np.array([0.5, -0.25])
    L, inverse = factorise([[first], [other, first]])
    x = back_substitute(L, inverse, reduce(L, [np.ones(2), np.zeros(2)]))
    for k in range(2):
        M = np.array([[first[k], other[k]], [other[k], first[k]]])
        assert np.allclose([x[0][k], x[1][k]], np.linalg.solve(M, [1.0, 0.0]), rtol=1e-12)


ORDERS = {"euler": 1, "rk4": 4, "cfmr7": 7, "dop853": 8}


def pendulum(t, y):
    return np.array([y[1], -np.sin(y[0]) + 0.5 * np.cos(1.3 * t)])


def integrate(method, steps, end=2.0):
    y, h = np.array([1.0, 0.3]), end / steps
    for i in range(steps):
        K = np.zeros((len(method.B), 2))
        for s, (a, c) in enumerate(zip(method.A, method.C, strict=True)):
            K[s] = pendulum((i + c) * h, y + h * np.array(a) @ K)
        y = y + h * np.array(method.B) @ K
    return y


@pytest.mark.parametrize("name", METHODS)
def test_error_falls_with_the_order_of_the_method(name):
    exact = solve_ivp(pendulum, (0.0, 2.0), [1.0, 0.3], method="DOP853", rtol=3e-14, atol=1e-15).y[
        :, -1
    ]
    errors = [np.abs(integrate(METHODS[name], steps) - exact).max() for steps in (4, 8)]
    assert np.log2(errors[0] / errors[1]) > ORDERS[name] - 0.5
    np.testing.assert_allclose(np.sum(METHODS[name].A, axis=1), METHODS[name].C, atol=1e-12)


def test_the_literals_of_dop853_are_those_of_scipy():
    method = METHODS["dop853"]
    np.testing.assert_array_equal(method.A, DOP853.A[:12, :12])
    np.testing.assert_array_equal(method.B, DOP853.B)
    np.testing.assert_array_equal(method.C, DOP853.C[:12])


def test_cfmr7_keeps_an_oscillation_that_rk4_damps():
    turn = 0.75  # rad a step: the fastest mode of three links in steps of 5 ms
    mode = np.array([100j * turn])
    assert abs(growth(METHODS["cfmr7"], mode, 1) - 1.0) < 2e-8
    assert growth(METHODS["rk4"], mode, 1) < 1.0 - 1e-3


@pytest.mark.parametrize("mode", [-3.0 + 40.0j, -250.0, -1e7 + 1e7j])
def test_growth_is_the_stability_polynomial_also_far_from_stable(mode):
    """R(z) of euler and rk4 is the exponential series to their order; at huge z a linear solver finds I - z A singular."""
    z = mode * 0.01
    modes = np.array([mode], dtype=complex)
    assert growth(METHODS["euler"], modes, 1) == pytest.approx(abs(1 + z))
    assert growth(METHODS["rk4"], modes, 1) == pytest.approx(
        abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    )
    assert np.isfinite(growth(METHODS["dop853"], modes, 1))


# together they use states, memory, grip, water, joint torques and every elementary function
COLOURFUL = "nonuniform_current wall_effect wake_memory wave_drag tether rotor_imbalance rudder_delay rotor_lag"


def colourful():
    """A fish with one link and many effects at typical strength."""
    typical = {
        name: {k: p.typical for k, p in EFFECTS[name].parameters.items() if p.typical is not None}
        for name in COLOURFUL.split()
    }
    return Robot(links=1, effects=typical)


@pytest.mark.parametrize("links", [1, 3])
def test_motion_is_that_of_scipy_with_tight_tolerance(links, strokes):
    robot = Robot(links=links)
    stepper = Stepper(robot.structure, compiled=False)
    commands = strokes(40)
    states = stepper.rollout(stepper.rest(), commands, stepper.parameters(robot))
    size, layout, p = 2 * (links + 3), Layout(robot.structure), robot.vector()
    x, alpha, speed = np.zeros(size), 0.0, 0.0
    for rotor, rudder in commands:
        alpha_dot = float(np.clip((rudder - alpha) / 0.01, -6.0, 6.0))
        ramp = (rotor - speed) / 0.01
        drive = (alpha, alpha_dot, speed, ramp)

        def rate(t, x, drive=drive):
            alpha, alpha_dot, speed, ramp = drive
            return motion_rate(
                layout, x, (alpha + alpha_dot * t, alpha_dot, speed + ramp * t, ramp), p, NUMPY
            )

        x = solve_ivp(rate, (0.0, 0.01), x, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
        alpha, speed = alpha + alpha_dot * 0.01, rotor
    np.testing.assert_allclose(states[-1, :size], x, rtol=1e-5, atol=1e-6)
    assert states[-1, size] == pytest.approx(alpha)
    assert states[-1, size + 1] == speed


def test_compiled_interpreted_and_torch_forms_agree(strokes):
    robot, scheme = colourful(), Scheme("rk4")
    compiled, interpreted = (Stepper(robot.structure, scheme, compiled=c) for c in (True, False))
    commands, p = strokes(30), compiled.parameters(robot)
    start = np.tile(compiled.rest((0.3, 0.8, 0.2)), (5, 1))
    start[:, 4] = np.linspace(-0.4, 0.4, 5)  # not a multiple of any vector width
    values = [s.rollout(start, commands, p) for s in (compiled, interpreted)]
    np.testing.assert_allclose(values[0], values[1], rtol=1e-8, atol=1e-10)
    arguments = [torch.from_numpy(v) for v in (start, commands[:3], p)]
    generic = torch_step.rollout(*arguments, compiled, generic=True)
    np.testing.assert_allclose(generic.numpy(), values[0][:4], rtol=1e-8, atol=1e-10)
    adjoint = np.random.default_rng(0).normal(size=values[0].shape)
    for a, b in zip(
        *(s.rollout_vjp(values[0], commands, p, adjoint) for s in (compiled, interpreted)),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-8 * np.abs(b).max())


@pytest.mark.parametrize(("device", "dtype"), [("meta", torch.float64), ("cpu", torch.float32)])
def test_the_generic_form_stays_on_its_device_and_in_its_precision(strokes, device, dtype):
    """`meta` computes no numbers but refuses, like a graphics card, tensors of another device."""
    robot = Robot(links=1, effects={name: {} for name in EFFECTS})
    stepper = Stepper(robot.structure, Scheme("euler"), compiled=False)
    values = (np.tile(stepper.rest((0.3, 0.8, 0.2)), (4, 1)), strokes(1), stepper.parameters(robot))
    start, commands, p = (
        torch.tensor(v, device=device, dtype=dtype, requires_grad=True) for v in values
    )
    states = torch_step.rollout(start, commands, p, stepper)
    states[-1].sum().backward()
    assert all(
        t.device.type == device and t.dtype == dtype
        for t in (states, start.grad, commands.grad, p.grad)
    )
    if device == "cpu":
        np.testing.assert_allclose(states.detach().numpy(), stepper.rollout(*values), atol=1e-4)


def test_states_commands_and_parameters_may_each_carry_the_batch(strokes):
    robot = Robot()
    stepper = Stepper(robot.structure, compiled=False)
    p, commands = stepper.parameters(robot), strokes(5)
    single = stepper.rollout(stepper.rest(), commands, p)
    for start, c, q in (
        (np.tile(stepper.rest(), (2, 3, 1)), commands, p),
        (stepper.rest(), np.tile(commands[:, None, None], (1, 2, 3, 1)), p),
        (stepper.rest(), commands, np.tile(p, (2, 3, 1))),
    ):
        batch = stepper.rollout(start, c, q)
        assert batch.shape == (6, 2, 3, 14)
        np.testing.assert_allclose(
            batch, np.broadcast_to(single[:, None, None], batch.shape), atol=1e-13
        )


def test_the_servo_moves_at_its_rate_limit_and_stops_at_its_range():
    robot = Robot()
    stepper = Stepper(robot.structure, compiled=False)
    states = stepper.rollout(
        stepper.rest(), np.tile([0.0, 2.0], (20, 1)), stepper.parameters(robot)
    )
    expected = np.minimum(0.06 * np.arange(21), 0.8)
    np.testing.assert_allclose(states[:, 12], expected, atol=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_diverging_batch_element_is_flagged_and_leaves_the_others_alone(strokes, compiled):
    robot = Robot()
    stepper = Stepper(robot.structure, compiled=compiled)
    start = np.tile(stepper.rest(), (6, 1))
    start[1, 6:12], start[4, 0] = 1e200, np.nan
    commands, p = strokes(20), stepper.parameters(robot)
    states = stepper.rollout(start, commands, p)
    np.testing.assert_array_equal(diverged(states), [False, True, False, False, True, False])
    alone = stepper.rollout(stepper.rest(), commands, p)
    np.testing.assert_allclose(
        states[:, [0, 2, 3, 5]], np.tile(alone[:, None], (1, 4, 1)), atol=1e-12
    )


def test_a_batch_of_none_is_no_error(strokes):
    stepper = Stepper.of(Robot())
    start, p = stepper.rest(), stepper.parameters(Robot())
    commands = strokes(1)
    states = stepper.rollout(np.empty((0, len(start))), commands, p)
    assert states.shape == (len(commands) + 1, 0, len(start))
    none = np.empty((0, len(start))), np.zeros((len(commands), 0, 2)), np.empty((0, len(p)))
    tangents = stepper.rollout_jvp(np.empty((0, len(start))), commands, p, *none)[1]
    adjoints = stepper.rollout_vjp(states, commands, np.empty((0, len(p))), np.zeros_like(states))
    assert tangents.shape == states.shape
    assert [a.shape for a in adjoints] == [(0, len(start)), (len(commands), 0, 2), (0, len(p))]


def test_wrong_shapes_and_other_robots_are_refused():
    stepper = Stepper(Robot().structure, compiled=False)
    p = stepper.parameters(Robot())
    with pytest.raises(ValueError, match=r"state: got shape \(13,\); expected \(\.\.\., 14\)"):
        stepper.step(np.zeros(13), np.zeros(2), p)
    with pytest.raises(ValueError, match=r"commands: got shape"):
        stepper.step(stepper.rest(), np.zeros(3), p)
    with pytest.raises(ValueError, match="structure"):
        stepper.parameters(Robot(links=2))
    with pytest.raises(ValueError, match="method: got 'leapfrog'"):
        Scheme("leapfrog")
    with pytest.raises(ValueError, match="substeps: got 0"):
        Scheme(substeps=0)


def test_numbers_that_are_not_finite_are_named():
    stepper = Stepper(Robot().structure, compiled=False)
    rest, command, p = stepper.rest(), np.zeros(2), stepper.parameters(Robot())
    bad_state, bad_parameters = rest.copy(), p.copy()
    bad_state[3], bad_parameters[0] = np.nan, np.inf
    stepper.step(rest, command, p)
    with pytest.raises(ValueError, match=r"state theta_1.*: got nan; expected a finite number"):
        stepper.step(bad_state, command, p)
    with pytest.raises(ValueError, match=r"command rudder.*: got inf"):
        stepper.step(rest, np.array([0.0, np.inf]), p)
    with pytest.raises(ValueError, match=r"parameter head_mass.*: got inf"):
        stepper.step(rest, command, bad_parameters)
    with pytest.raises(ValueError, match=r"parameter head_mass.*: got inf"):
        torch_step.step(*map(torch.from_numpy, (rest, command, bad_parameters)), stepper)
    with pytest.raises(ValueError, match=r"state theta_1 of batch element \(1,\): got nan"):
        check_finite("state", np.stack([rest, bad_state]), stepper.layout.state)


def test_a_step_too_coarse_for_the_tail_is_refused_with_the_number_that_works():
    robot, commands = Robot(links=5), np.tile([0.0, 0.0], (200, 1))
    with pytest.raises(ValueError, match=r"substeps = 1 \(rk4, 10 ms\).* use substeps >= 3"):
        Stepper.of(robot, Scheme("rk4", 1))
    fine = Stepper.of(robot, Scheme("rk4", 3))
    coarse = Stepper(
        robot.structure, Scheme("rk4", 1), compiled=False
    )  # not asked: it blows up, and that shows
    start = fine.rest()
    start[7] = 0.01
    p = fine.parameters(robot)
    assert diverged(coarse.rollout(start, commands, p))
    assert not diverged(fine.rollout(start, commands, p))


def test_fastest_mode_of_the_nominal_tail_is_about_150_per_second():
    modes = modes_at_rest((3, ()), np.array(Robot().vector()))
    assert np.abs(modes).max() == pytest.approx(150, rel=0.02)
    assert modes.real.max() < 1e-6  # at rest everything decays or stays


@pytest.mark.parametrize("links", [1, 2, 3, 4, 5])
def test_a_default_step_turns_the_fastest_mode_by_less_than_a_radian(links):
    robot = Robot(links=links)
    modes = modes_at_rest(robot.structure, np.array(robot.vector()))
    scheme = default_scheme(links)
    assert np.abs(modes.imag).max() * DT / scheme.substeps < 0.87
    assert stable_scheme(robot) == scheme == Stepper.of(robot).scheme


@pytest.mark.parametrize("links", [1, 3, 5])
def test_a_robot_with_a_stiff_tail_gets_steps_that_are_stable(links):
    highest = EFFECTS["tail_joint_damping"].parameters["c"].highest
    robot = Robot(links=links).with_effect("tail_joint_damping", c=highest)
    check_scheme(Stepper.of(robot).scheme, robot)
    if links == 5:
        with pytest.raises(ValueError, match="unstable for this robot"):
            check_scheme(default_scheme(links), robot)


def test_a_tail_too_stiff_for_any_step_is_refused():
    with pytest.raises(ValueError, match=r"fastest mode, .* too fast for 256 substeps"):
        Stepper.of(Robot(links=5).with_parameters(tail_stiffness=1e6))


def test_the_comparison_with_the_reference_says_when_there_is_none(tmp_path):
    script = Path(__file__).parent.parent / "benchmarks" / "check_reference.py"
    run = subprocess.run([sys.executable, script, tmp_path], capture_output=True, text=True)
    assert run.returncode == 2
    assert "no reference trajectories" in run.stderr
    assert str(tmp_path) in run.stderr
