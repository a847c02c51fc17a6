# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A law of the remaining force: a hidden one is read off with its coefficient, and nothing where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.compiled import compiler
from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.ops import NUMPY
from fish_sim.pool import LENGTH, WIDTH
from fish_sim.robot import Robot
from fish_sim.scheme import default_scheme
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.cross_validation import Quadratic
from fish_sysid.diagnosis.residual_regression import (
    TERMS,
    FreeForce,
    choose_terms,
    cross_validated,
    regressors,
    residual_law,
)
from fish_sysid.estimation.ekf_compiled import filter_library
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

MOMENT = 1e-3  # N m, of a magnet that turns the fish to the side


def left_by_the_nominal_model(**hidden: float):
    """The law that the true nominal parameters leave of a fish with these coefficients of a free force."""
    random = np.random.default_rng(4)
    commands = np.stack(
        [program(k, 6.0, random) for k in ("sines", "steps", "random", "sines")], axis=1
    )
    robot = Robot(links=1, table={**EFFECTS, FreeForce.name: FreeForce})
    robot = robot.with_effect(FreeForce.name, **hidden) if hidden else robot
    fish = record(robot, commands, Noise(), random)[0]
    hypothesis = nominal_hypothesis(Robot(links=1))
    fit = evaluate(hypothesis, hypothesis.parametrization.origin(), fish, Noise())
    return residual_law(fit, fish)


def test_a_hidden_law_is_read_off_with_its_coefficient_on_its_degree_of_freedom():
    law = left_by_the_nominal_model(**{f"yaw_{TERMS.index('cos(heading)')}": MOMENT})
    assert law.terms["yaw"]["cos(heading)"] == pytest.approx(MOMENT, rel=0.15)
    assert max(law.gain, key=lambda dof: law.gain[dof]) == "yaw"
    assert law.gain["yaw"] > 100.0


def test_water_alone_follows_no_law():
    law = left_by_the_nominal_model()
    assert max(law.gain.values()) < 5.0  # nats on trials that the terms were not chosen on


def test_a_step_is_the_minimum_over_fitted_and_chosen_parameters():
    random = np.random.default_rng(0)
    root = random.standard_normal((6, 6))
    cost = Quadratic(100.0 * random.standard_normal(6), root @ root.T, 2)
    step = cost.best_step([4])
    assert not step[[2, 3, 5]].any()
    for j in (0, 1, 4):
        for h in (-1e-4, 1e-4):
            assert cost.cost(step) < cost.cost(step + h * np.eye(6)[j])
    first = min(range(2, 6), key=lambda j: cost.cost(cost.best_step([j])))
    assert choose_terms(cost, range(2, 6))[0] == first


def test_a_term_that_gains_no_more_than_chance_is_not_chosen():
    weak, strong = -np.sqrt(2.0 * 9.0), -np.sqrt(2.0 * 11.0)  # gains of 9 and 11 nats
    assert choose_terms(Quadratic(np.array([0.0, weak, strong]), np.eye(3), 1), (1, 2)) == [2]


@pytest.mark.parametrize(
    ("pulls", "gain"), [((1, 1, 1, 1), 4 * 50.0), ((1, 1, 1, -1), 3 * 250.0 / 9.0 - 150.0)]
)
def test_a_law_is_judged_on_the_trial_it_was_not_chosen_on(
    pulls: tuple[int, ...], gain: float
) -> None:
    """Four trials of normal matrix 1, a term pulled by 10 each: steps of 10, or of 10 / 3 where one of three pulls back."""
    gradients = -10.0 * np.column_stack([np.zeros(4), pulls])
    normals = np.tile(np.eye(2), (4, 1, 1))
    found = cross_validated(gradients, normals, np.zeros(1), np.array([1e6]), (1,))
    assert found == pytest.approx(gain, rel=1e-6)


def test_terms_that_nothing_tells_apart_do_no_harm():
    normal = np.array(
        [[2.0, 1.0, 1.0, 0.0], [1.0, 3.0, 3.0, 0.0], [1.0, 3.0, 3.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
    )
    cost = Quadratic(100.0 * np.array([0.1, 1.0, 1.0, 0.0]), normal, 1)
    chosen = choose_terms(cost, (1, 2, 3))
    assert 3 not in chosen  # never excited
    assert cost.cost(cost.best_step(chosen)) == pytest.approx(
        cost.cost(cost.best_step([1])), rel=1e-6
    )


@pytest.mark.parametrize(("x", "y"), [(LENGTH / 2 - 0.2, 0.0), (0.0, 0.2 - WIDTH / 2)])
def test_a_wall_is_felt_less_by_a_factor_e_two_decimetres_away(x, y):
    body = BodyMotion("head", x, y, 0.6, 0.8, 0.2, -0.1, 0.5, 0.0, 0.0, 0.0)
    terms = regressors(body, 3.0, Drive(-0.4, 0.0, 20.0, 0.0), NUMPY)
    assert terms["surge_speed exp(-wall_distance/0.2 m)"] == pytest.approx(0.2 / np.e)
    assert terms["rudder |rudder|"] == pytest.approx(-0.16)
    assert terms["time yaw_rate"] == 1.5
    assert terms["cos(heading)"] == 0.6
    assert terms["surge_speed rudder"] == pytest.approx(-0.08)


def test_the_free_force_is_no_candidate():
    assert FreeForce.name not in EFFECTS


def test_a_law_is_the_same_in_batches_of_one_trial():
    """A pass with a hundred derivatives holds kilobytes of every 10 ms."""
    random = np.random.default_rng(2)
    commands = np.stack([program(kind, 2.0, random) for kind in ("sines", "steps", "turn")], axis=1)
    fish = record(Robot(links=1).with_effect("current", x=0.03), commands, Noise(), random)[0]
    nominal = nominal_hypothesis(Robot(links=1))
    fit = evaluate(nominal, np.zeros(len(nominal.free)), fish, Noise())
    whole = residual_law(fit, fish)
    more = ((0, 5000 - fish.length), (0, 0))
    padded = {
        key: np.pad(getattr(fish, key), more, constant_values=np.nan) for key in ("gyro", "encoder")
    }
    padded |= {key: np.pad(getattr(fish, key), (*more, (0, 0))) for key in ("commands", "accel")}
    long = replace(fish, **padded)
    assert (fish.batches(), long.batches()) == ([[0, 1, 2]], [[0], [1], [2]])
    again = residual_law(fit, long)
    assert again.terms.keys() == whole.terms.keys()
    assert again.gain == pytest.approx(whole.gain, rel=1e-9)


@pytest.mark.skipif(compiler() is None, reason="no C compiler on this computer")
@pytest.mark.parametrize("links", [1, 3])
def test_the_filter_with_a_free_force_is_compiled(links, caplog):
    """Its coefficients multiply squares of a rotor's speed: the self-check's fish must not be thrown out of the water."""
    structure = (links, (FreeForce, EFFECTS["disturbance"]))
    assert filter_library(structure, default_scheme(links).method) is not None
    assert "no compiled kernel" not in caplog.text
