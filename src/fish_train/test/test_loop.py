# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The closed loop of training and of evaluation against autograd, finite differences, other batches, and what the nodes run.

The nodes run fish_control's Controller, Planner and PathBatch.
"""

from dataclasses import replace

import numpy as np
import pytest

from fish_control.controller import Controller, Reference
from fish_control.line_of_sight import GuidanceConfig, Motion
from fish_control.path_batch import PathBatch, TrackerConfig
from fish_control.paths import make_path
from fish_control.planner import Planner
from fish_control.policy import Policy
from fish_control.policy_spec import INPUTS, PolicySpec
from fish_sim.model import DT
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper
from fish_train.evaluation.candidates import PolicyGains
from fish_train.evaluation.follow import Follower
from fish_train.training import compiled_loop
from fish_train.training.batch import BatchState, PathBank, PathTable, locate
from fish_train.training.closed_loop_equations import Law, path_ahead
from fish_train.training.compiled_loop import CompiledLoop, fastest_loop
from fish_train.training.network import FORMS, initial_weights, to_tensors, weight_count
from fish_train.training.torch_loop import TorchLoop

START_GAINS = {
    "steering_kp": 0.5,
    "steering_ki": 0.2,
    "steering_kd": 0.05,
    "speed_kp": 0.6,
    "speed_ki": 0.03,
    "speed_kd": 0.01,
}
COST = np.array([1.0, 10.0, 20.0, 2.0, 0.01, 0.2])
compiled = pytest.mark.skipif(not CompiledLoop.available(), reason="no C compiler")
shipped = pytest.mark.usefixtures("shipped_flags")
SPEED = 0.2  # m/s
STEPS = 100  # control periods
START = (0.02, -0.03, 0.15)  # beside a straight path, m, m, rad
PATHS = {
    "letter": lambda: make_path("R"),
    "circle": lambda: make_path("circle", radius=0.6),
    "tight": lambda: make_path("circle", radius=0.15),  # never leaves the lookahead circle
    "closed once": lambda: make_path("circle", radius=0.4, end="stop"),
    "again": lambda: make_path("straight", length=0.8, end="loop"),
}


def make_stepper(compiled: bool = True) -> Stepper:
    """The integration of training."""
    return Stepper(Robot().structure, Scheme("rk4", 1), compiled)


def make_bank(law: Law) -> PathBank:
    """A closed and an open path."""
    paths = [make_path("circle", radius=0.8), make_path("sinusoid", amplitude=0.5, length=3.4)]
    return PathBank(paths, law.tracker)


def make_weights(form: str, rng: np.random.Generator) -> np.ndarray:
    """A network that is neither constant nor saturated."""
    weights = initial_weights(rng, START_GAINS, FORMS[form].layers)
    return weights + 0.02 * rng.standard_normal(weights.shape)


def make_batch(
    stepper: Stepper, bank: PathBank, batch: int, rng: np.random.Generator
) -> BatchState:
    """Fish beside the starts of their paths, swimming at 0.15 m/s."""
    path = np.arange(batch) % len(bank)
    poses = np.array([[*bank.paths[k].point(0.3), bank.paths[k].heading_at(0.3)] for k in path])
    poses += rng.normal(0.0, [0.02, 0.02, 0.1], (batch, 3))
    plant = np.array([stepper.rest(tuple(pose)) for pose in poses])
    size = stepper.layout.links + 3
    plant[:, size : size + 2] = 0.15 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    seen = np.column_stack([poses, np.full(batch, 0.15), np.zeros((batch, 2))])
    batch_state = BatchState.at(
        plant, stepper.parameters(Robot()), path, rng.uniform(0.1, 0.3, batch), seen
    )
    batch_state.place[:, [0, 2]] = 0.3
    return batch_state


def both(form: str = "network"):
    law, stepper = Law(inputs=FORMS[form].inputs), make_stepper()
    bank = make_bank(law)
    layers = FORMS[form].layers
    return (
        CompiledLoop(stepper, law, bank, layers),
        TorchLoop(stepper, law, bank, layers),
        stepper,
        bank,
    )


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


@shipped
@compiled
def test_cost_gradient_and_state_agree_with_autograd() -> None:
    kernel, torch_loop, stepper, bank = both()
    rng = np.random.default_rng(1)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 5, rng)
    batch_state.delay[:] = [0, 3, 1, 2, 30]
    for _ in range(2):  # the second window begins with a history and controllers that have run
        noise = 0.01 * rng.standard_normal((5, 5, 6))
        ours, theirs = batch_state.copy(), batch_state.copy()
        a = kernel.window(weights, ours, 4, COST, noise, hold=2)
        b = torch_loop.window(weights, theirs, 4, COST, noise, hold=2)
        assert a.cost == pytest.approx(b.cost, rel=1e-12)
        assert relative(a.gradient, b.gradient) < 1e-10
        assert np.allclose(a.report, b.report, atol=1e-12)
        assert np.allclose(a.applied, b.applied, atol=1e-12)
        for name, value in vars(theirs).items():
            assert np.allclose(getattr(ours, name), value, atol=1e-10), name
        batch_state = ours


@shipped
@compiled
@pytest.mark.parametrize("form", ["schedule", "constant"])
def test_baseline_forms_agree_with_autograd(form: str) -> None:
    kernel, torch_loop, stepper, bank = both(form)
    rng = np.random.default_rng(2)
    weights, batch_state = make_weights(form, rng), make_batch(stepper, bank, 2, rng)
    a = kernel.window(weights, batch_state.copy(), 3, COST)
    b = torch_loop.window(weights, batch_state.copy(), 3, COST)
    assert len(weights) == weight_count(FORMS[form].layers)
    assert a.cost == pytest.approx(b.cost, rel=1e-12)
    assert relative(a.gradient, b.gradient) < 1e-10


@shipped
@compiled
def test_gradient_agrees_with_finite_differences() -> None:
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(3)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 8, rng)
    kernel.window(weights, batch_state, 60, COST, gradient=False)  # away from the start's symmetry
    gradient = kernel.window(weights, batch_state.copy(), 15, COST).gradient
    for _ in range(3):
        along = rng.standard_normal(len(weights))
        along /= np.linalg.norm(along)
        step = 1e-5
        costs = [
            kernel.window(
                weights + s * step * along, batch_state.copy(), 15, COST, gradient=False
            ).cost
            for s in (1.0, -1.0)
        ]
        assert (costs[0] - costs[1]) / (2.0 * step) == pytest.approx(
            gradient @ along, rel=1e-5, abs=1e-9
        )


@shipped
@compiled
def test_a_batch_equals_its_fish_one_by_one() -> None:
    """11 fish: a full block and a part of one; the padding lanes count for nothing."""
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(4)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 11, rng)
    together, costs, gradients = batch_state.copy(), [], []
    whole = kernel.window(weights, together, 10, COST)
    for k in range(11):
        alone = batch_state.copy()
        for name, value in vars(batch_state).items():
            setattr(alone, name, value[k : k + 1].copy())
        single = kernel.window(weights, alone, 10, COST)
        costs.append(single.cost)
        gradients.append(single.gradient)
        assert np.allclose(alone.plant[0], together.plant[k], rtol=1e-12, atol=1e-12)
    assert whole.cost == pytest.approx(np.mean(costs), rel=1e-12)
    assert relative(whole.gradient, np.mean(gradients, axis=0)) < 1e-11


@shipped
def test_without_a_compiler_the_numbers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    law, rng = Law(), np.random.default_rng(5)
    bank = make_bank(law)
    interpreted = make_stepper(compiled=False)
    weights, batch_state = make_weights("network", rng), make_batch(interpreted, bank, 2, rng)
    slow = TorchLoop(interpreted, law, bank).window(weights, batch_state.copy(), 4, COST)
    if CompiledLoop.available():
        fast = CompiledLoop(make_stepper(), law, bank).window(weights, batch_state.copy(), 4, COST)
        assert slow.cost == pytest.approx(fast.cost, rel=1e-12)
        assert relative(slow.gradient, fast.gradient) < 1e-10
    monkeypatch.setenv("FISH_SIM_NO_COMPILER", "1")
    assert not CompiledLoop.available()


@shipped
@compiled
@pytest.mark.parametrize("width", [2, 4, 8])
def test_a_loop_that_the_compiler_gets_wrong_is_that_of_torch(
    wrong_compiler, caplog, monkeypatch, width
) -> None:
    """Wrong is the gradient alone: what travels back through the actuators. At the width of every processor."""
    law = Law(inputs="none")
    wrong_compiler("s/copy(g_actuator, NA, g->actuator)/zero(g->actuator, NA)/")
    monkeypatch.setattr(compiled_loop, "lanes", lambda: width)
    loop = fastest_loop(make_stepper(), law, make_bank(law), FORMS["constant"].layers)
    assert isinstance(loop, TorchLoop)
    assert "the slower interpreted form is used" in caplog.text


@shipped
@compiled
def test_a_fish_that_is_nowhere_does_not_crash_the_kernel() -> None:
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(6)
    batch_state = make_batch(stepper, bank, 3, rng)
    batch_state.plant[1, 0] = np.nan
    result = kernel.window(make_weights("network", rng), batch_state, 5, COST)
    assert np.isnan(result.cost)
    assert np.all(np.isfinite(batch_state.plant[[0, 2]]))


@shipped
def test_hold_must_divide_the_window() -> None:
    law = Law()
    bank, stepper, rng = make_bank(law), make_stepper(), np.random.default_rng(7)
    loop = TorchLoop(stepper, law, bank)
    with pytest.raises(ValueError, match="hold: got 4 for a window of 10"):
        loop.window(
            make_weights("network", rng), make_batch(stepper, bank, 1, rng), 10, COST, hold=4
        )


def motion_of(state: np.ndarray, size: int) -> Motion:
    cos, sin = np.cos(state[2]), np.sin(state[2])
    vx, vy, rate = state[size : size + 3]
    return Motion(*map(float, (*state[:3], cos * vx + sin * vy, cos * vy - sin * vx, rate)))


def node_swim(policy: Policy, path, stepper) -> np.ndarray:
    """States (STEPS, NS) at control instants under the node's own classes."""
    controller, planner = Controller(policy), Planner(path, SPEED)
    state, parameters, rows = stepper.rest(START), stepper.parameters(Robot()), []
    size = stepper.layout.links + 3
    start = motion_of(state, size)
    for observer in (
        controller,
        planner,
    ):  # the first message only sets the clock; training sees the other two
        for time in (-2.0 * DT, -DT, 0.0):
            observer.observe(time, start)
    for k in range(STEPS * 2):
        if k % 2 == 0:
            plan = planner.plan(motion_of(state, size))
            controller.decide(
                Reference(plan.errors.course, plan.speed, plan.yaw_rate, plan.errors.cross_track)
            )
        command = controller.command(DT)
        state = stepper.step(state, np.array([command.rotor_speed, command.alpha]), parameters)
        for observer in (controller, planner):
            observer.observe((k + 1) * DT, motion_of(state, size))
        if k % 2:
            rows.append(state)
    return np.array(rows)


def law_of(listen_time: float) -> Law:
    return Law(guidance=GuidanceConfig(listen_time=listen_time))


@pytest.fixture(scope="module")
def setting():
    """Weights, policy, path, stepper; the node's states by how long the fish listens before it swims."""
    rng = np.random.default_rng(9)
    start = {
        "steering_kp": 0.4,
        "steering_ki": 0.3,
        "steering_kd": 0.03,
        "speed_kp": 0.6,
        "speed_ki": 0.05,
        "speed_kd": 0.01,
    }
    weights = initial_weights(rng, start)
    weights += 0.02 * rng.standard_normal(weights.shape)
    path, stepper = make_path("straight", length=3.0, x=1.5), make_stepper()
    policies = {
        t: Policy(PolicySpec(guidance=law_of(t).guidance), to_tensors(weights)) for t in (0.0, 0.5)
    }
    return (
        weights,
        policies,
        path,
        stepper,
        {t: node_swim(p, path, stepper) for t, p in policies.items()},
    )


def test_training_runs_the_nodes_laws(setting) -> None:
    weights, _, path, stepper, expected = setting
    law = law_of(0.0)
    bank = PathBank([path], law.tracker)
    kind = CompiledLoop if CompiledLoop.available() else TorchLoop
    seen = np.array([[*START, 0.0, 0.0, 0.0]])
    batch_state = BatchState.at(
        stepper.rest(START)[None], stepper.parameters(Robot()), np.zeros(1), np.array([SPEED]), seen
    )
    loop = kind(stepper, law, bank)
    for k in range(0, STEPS, 20):
        loop.window(weights, batch_state, 20, COST, gradient=False)
        assert np.allclose(batch_state.plant[0], expected[0.0][k + 19], atol=1e-9)


@pytest.mark.parametrize("listen_time", [0.0, 0.5])
def test_the_follower_runs_the_nodes_laws(setting, listen_time) -> None:
    _, policies, path, stepper, node = setting
    law, known, expected = law_of(listen_time), np.ones(2, dtype=bool), node[listen_time]
    follower = Follower(
        [path, path], np.array([SPEED, 0.3]), PolicyGains(policies[listen_time]), law
    )
    state, parameters = np.array([stepper.rest(START)] * 2), stepper.parameters(Robot())
    size = stepper.layout.links + 3
    seen = np.array([motion_of(row, size) for row in state])
    for k in range(STEPS * 2):
        if k % 2 == 0:
            for _ in range(2 if k == 0 else 0):
                follower.observe(seen, known)
            follower.decide(seen, known)
        state = stepper.step(state, follower.command(), parameters)
        seen = np.array([motion_of(row, size) for row in state])
        follower.observe(seen, known)
        if k % 2:
            assert np.allclose(state[0], expected[k // 2], atol=1e-9)
    assert abs(state[0, size]) > 0.01  # it swims


def test_the_follower_asks_a_policy_in_its_own_scales(setting) -> None:
    """A file whose inputs have other scales gives the node's gains."""
    _, policies, path, stepper, _ = setting
    scales = tuple(replace(i, scale=3.0 * i.scale, offset=0.2) for i in INPUTS)
    policy = Policy(replace(policies[0.0].contract, inputs=scales), policies[0.0].tensors)
    start = motion_of(stepper.rest(START), stepper.layout.links + 3)
    follower = Follower([path], np.array([SPEED]), PolicyGains(policy), law_of(0.0))
    controller, planner = Controller(policy), Planner(path, SPEED)
    for observer in (controller, planner):
        for time in (-2.0 * DT, -DT, 0.0):
            observer.observe(time, start)
    plan = planner.plan(start)
    wanted = Reference(plan.errors.course, plan.speed, plan.yaw_rate, plan.errors.cross_track)
    seen, known = np.array([start]), np.ones(1, dtype=bool)
    for _ in range(2):
        follower.observe(seen, known)
    follower.decide(seen, known)
    assert follower.gains[0] == pytest.approx(controller.decide(wanted), abs=1e-12)


@pytest.mark.parametrize("name", PATHS)
def test_along_a_wandering_swim(name: str) -> None:
    path, tracker = PATHS[name](), TrackerConfig()
    table, batch = PathTable.of(path, tracker), PathBatch([path], tracker)
    place, rng = np.zeros(2), np.random.default_rng(8)
    offset = 0.3  # m, beyond the capture distance at first
    for s in np.linspace(-0.1, 2.2 * min(path.length, 3.0), 150):
        offset = 0.9 * offset + 0.01 * rng.standard_normal()
        heading = float(path.heading_at(s))
        position = path.point(s) + offset * np.array([-np.sin(heading), np.cos(heading)])
        expected = batch.update(position[None])
        ahead = path_ahead(
            *position, locate(table, tracker, place, position), tracker.lookahead, NUMPY
        )
        assert place[0] == pytest.approx(expected.progress[0], abs=1e-12)
        assert [ahead.x, ahead.y] == pytest.approx(expected.point[0], abs=1e-12)
        assert [ahead.target_x, ahead.target_y] == pytest.approx(expected.target[0], abs=1e-9)
        assert ahead.heading == pytest.approx(expected.heading[0], abs=1e-12)
        assert ahead.curvature == pytest.approx(expected.curvature[0], abs=1e-12)
        assert ahead.chord == pytest.approx(expected.chord[0], abs=1e-9)
