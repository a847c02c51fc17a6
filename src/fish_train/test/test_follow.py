# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The batch follower and the training loop run what the nodes run: fish_control's Controller and Planner."""

from dataclasses import replace

import numpy as np
import pytest
from training_setup import COST, make_stepper

from fish_control.controller import Controller, Reference
from fish_control.line_of_sight import GuidanceConfig, Motion
from fish_control.paths import make_path
from fish_control.planner import Planner
from fish_control.policy import Policy
from fish_control.policy_spec import INPUTS, PolicySpec
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_train.evaluation.follow import Follower
from fish_train.evaluation.gains_source import PolicyGains
from fish_train.training.batch_state import BatchState
from fish_train.training.closed_loop_equations import Law
from fish_train.training.compiled_loop import CompiledLoop
from fish_train.training.network import initial_weights, to_tensors
from fish_train.training.path_bank import PathBank
from fish_train.training.torch_loop import TorchLoop

SPEED = 0.2  # m/s
STEPS = 100  # control periods
START = (0.02, -0.03, 0.15)  # beside a straight path, m, m, rad


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
