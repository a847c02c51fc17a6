# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The force that is left, its law, and answers in a degenerate limit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_fits import made_fit

from fish_node.pool import LENGTH, WIDTH
from fish_sim.compiled import compiler
from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.scheme import default_scheme
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.corrected_model import named, refused, verdict
from fish_sysid.diagnosis.cross_validation import Quadratic
from fish_sysid.diagnosis.degenerate import LIMITS, degenerate
from fish_sysid.diagnosis.effect_wrench import intervals, regimes, size
from fish_sysid.diagnosis.latent_force import (
    MissingForce,
    covariate_shares,
    dof_shares,
    place_shares,
    time_shares,
)
from fish_sysid.diagnosis.residual_regression import (
    TERMS,
    FreeForce,
    Law,
    choose_terms,
    cross_validated,
    regressors,
    residual_law,
)
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.ekf_compiled import filter_library
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import Parametrization, effect_class, nominal_hypothesis

UNIT = np.array([0.1, 0.1, 0.001])  # N, N, N m: what counts as one


def force(surge: np.ndarray, **covariates: np.ndarray) -> MissingForce:
    """Force ahead only (T, M), zero at once beyond a trial's end where it is NaN."""
    wrench = np.stack([surge, 0.0 * surge, 0.0 * surge], axis=-1)
    names = tuple(f"trial_{m:02d}" for m in range(surge.shape[1]))
    return MissingForce(names, wrench, np.zeros_like(wrench), covariates)


@pytest.fixture
def pushed() -> MissingForce:
    """0.2 N from 2 to 8 s of the second of two trials, right of the pool's middle and at large rudder angles."""
    t = 0.01 * np.arange(1000)
    when = (t >= 2.0) & (t < 8.0)
    surge = np.column_stack([np.zeros(1000), np.where(when, 0.2, 0.0)])
    random = np.random.default_rng(0)
    calm, moved = random.uniform(-0.5, 0.3, (1000, 2)), random.uniform(0.3, 0.5, 1000)
    rudder = calm.copy()
    rudder[when, 1] = moved[when]
    x = np.where(surge > 0.0, 0.3, -0.3) + random.uniform(-0.05, 0.05, (1000, 2))
    speed, still = random.standard_normal((1000, 2)), np.ones((1000, 2))
    return force(
        surge,
        rudder=rudder,
        x=x,
        y=0.0 * x,
        surge_speed=speed,
        rotor_speed=still,
        time=np.tile(t[:, None], 2),
    )


def test_the_windows_that_hold_most_of_a_force_have_their_share(
    pushed: MissingForce,
) -> None:
    rows = time_shares(pushed, UNIT)
    found = sorted((row["trial"], row["from"], row["to"], row["share"]) for row in rows[:3])
    third = pytest.approx(1.0 / 3.0)
    assert found == [
        ("trial_01", 2.0, 4.0, third),
        ("trial_01", 4.0, 6.0, third),
        ("trial_01", 6.0, 8.0, third),
    ]
    assert rows[3]["share"] == 0.0


def test_the_cell_of_the_pool_in_which_a_force_acts_is_found(pushed: MissingForce) -> None:
    cell = place_shares(pushed, UNIT)[0]
    assert cell["share"] == pytest.approx(1.0)
    (left, right), (low, high) = cell["x"], cell["y"]
    assert left <= 0.25
    assert 0.35 <= right
    assert low <= 0.0 <= high
    assert right - left < 1.0


def test_a_force_beyond_the_map_is_in_no_cell(pushed: MissingForce) -> None:
    far = {**pushed.covariates, "x": pushed.covariates["x"] + 100.0}
    assert place_shares(replace(pushed, covariates=far), UNIT) == []


def test_the_covariate_is_found_in_whose_range_a_force_acts(pushed: MissingForce) -> None:
    rows = {row["name"]: row for row in covariate_shares(pushed, UNIT)}
    assert rows["rudder"]["range"] == pytest.approx([0.3, 0.5], abs=0.06)  # over two bins
    assert rows["rudder"]["share"] == pytest.approx(1.0)
    assert rows["rudder"]["contrast"] > 3.0
    assert rows["surge_speed"]["contrast"] < 1.5
    assert "rotor_speed" not in rows
    assert "time" not in rows


def test_a_rudder_that_rests_is_not_what_a_force_depends_on() -> None:
    """A bin that holds most of the time holds most of a force that acts all the time, and is no denser for that."""
    random = np.random.default_rng(0)
    rudder = np.where(random.random((4000, 1)) < 0.6, 0.0, random.uniform(-0.4, 0.4, (4000, 1)))
    rows = covariate_shares(force(random.standard_normal((4000, 1)), rudder=rudder), UNIT)
    assert rows[0]["contrast"] < 1.2
    rows = covariate_shares(force(np.where(rudder > 0.2, 0.2, 0.0), rudder=rudder), UNIT)
    assert rows[0]["range"] == pytest.approx([0.2, 0.4], abs=0.15)
    assert rows[0]["contrast"] > 3.0


def test_the_last_window_of_a_shorter_trial_ends_with_it() -> None:
    surge = np.full((1000, 2), 0.1)
    surge[550:, 1] = np.nan
    surge[:400] = 0.0
    rows = time_shares(force(surge), UNIT)
    assert [
        (r["from"], r["to"]) for r in rows if r["trial"] == "trial_01" and r["share"] > 0.0
    ] == [(4.0, 5.5)]


def test_a_force_is_in_units_of_each_degree_of_freedom() -> None:
    """A hundredth of a newton metre weighs ten times a tenth of a newton."""
    wrench = np.zeros((400, 1, 3))
    wrench[:200, 0, 1], wrench[200:, 0, 2] = 0.1, 0.01
    first, second = time_shares(MissingForce(("a",), wrench, wrench, {}), UNIT)
    assert first["from"] == 2.0
    assert first["share"] == pytest.approx(100.0 / 101.0)
    assert second["share"] == pytest.approx(1.0 / 101.0)


def test_a_force_that_swings_with_the_tail_acts_all_the_while() -> None:
    """Its root mean square over a stroke; the interval ends where the force does, to half a stroke."""
    t = 0.01 * np.arange(1000)
    swing = np.where((t >= 3.0) & (t < 7.0), 0.3 * np.sin(4.0 * np.pi * t), 0.0)
    beating = force(np.column_stack([swing, np.where(t < 5.0, 0.0, np.nan)]))
    np.testing.assert_allclose(size(beating, UNIT)[330:670, 0], 3.0 / np.sqrt(2.0), rtol=0.02)
    assert np.isnan(size(beating, UNIT)[500:, 1]).all()
    (row,) = intervals(beating, UNIT)
    assert row["trial"] == "trial_00"
    assert row["share"] > 0.95
    assert (row["from"], row["to"]) == pytest.approx((3.0, 7.0), abs=0.25)


def test_two_intervals_share_the_impulse_the_larger_first() -> None:
    t = 0.01 * np.arange(1000)
    rows = intervals(force(np.where(t < 2.0, 0.1, np.where(t >= 7.0, 0.1, 0.0))[:, None]), UNIT)
    assert [row["from"] for row in rows] == [pytest.approx(7.0, abs=0.25), 0.0]
    assert rows[0]["to"] == 10.0
    assert rows[0]["share"] == pytest.approx(0.6, abs=0.03)


def test_the_most_telling_covariate_comes_first_with_its_range(pushed: MissingForce) -> None:
    rows = regimes(pushed, UNIT)
    assert [row["f1"] for row in rows] == sorted((row["f1"] for row in rows), reverse=True)
    by_name = {row["name"]: row for row in rows}
    assert by_name["rudder"]["range"] == pytest.approx([0.3, 0.5], abs=0.05)
    assert by_name["rudder"]["f1"] > 0.9
    assert by_name["x"]["range"] == pytest.approx([0.25, 0.35], abs=0.06)
    assert by_name["x"]["share"] > 0.9
    assert by_name["surge_speed"]["f1"] < 0.6
    assert {"time", "rotor_speed"}.isdisjoint(by_name)


def fit(*wrench: float, tau: float = 0.2) -> SimpleNamespace:
    return SimpleNamespace(noise=Noise(wrench=wrench, wrench_time=tau))


def test_shares_of_the_degrees_of_freedom_are_of_the_variance_that_only_the_nominal_model_needs() -> (
    None
):
    shares = dof_shares(fit(0.008, 0.004, 6e-4), fit(0.004, 0.008, 2e-4))
    assert shares == {"surge": pytest.approx(3 / 11), "sway": 0.0, "yaw": pytest.approx(8 / 11)}
    assert dof_shares(fit(0.004, 0.008, 2e-4), fit(0.004, 0.008, 2e-4)) == {
        "surge": 0.0,
        "sway": 0.0,
        "yaw": 0.0,
    }


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


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("rudder_delay", {"delay": 0.3}, "range"),
        ("rudder_placement", {"tip_share": 1.0}, "range"),
        ("rudder_lag", {"time_constant": 0.0}, "no such effect"),
        ("tether", {"stiffness": 0.1, "length": 0.0, "x": 4.0, "y": -3.0}, "constant force"),
        ("sloshing", {"sine": 0.02, "cosine": 0.0, "frequency": 0.05}, "constant force"),
        ("wall_effect", {"k": 1.0, "length": 1.8}, "everywhere"),
        ("wake_memory", {"mobility": 0.1, "share": 0.0, "time_constant": 0.3}, "tip_slip"),
    ],
)
def test_a_limit_is_no_answer(name: str, values: dict[str, float], text: str) -> None:
    assert text in degenerate(name, values)


@pytest.mark.parametrize("name", candidates())
def test_no_effect_at_its_typical_strength_is_refused(name: str) -> None:
    effect = effect_class(name)
    values = {k: p.value for k, p in effect.parameters.items()}
    strong = {k: p.typical for k, p in effect.parameters.items() if p.typical is not None}
    assert degenerate(name, {**values, **strong}) == ""
    assert set(LIMITS) <= set(EFFECTS)


def diagnosed(**place: float):
    """A diagnosis that found a tether here, which explains everything."""
    fit = made_fit(0.0, "tether")
    free = fit.hypothesis.free
    values = {"stiffness": 0.2, "length": 0.5, "x": 0.4, "y": 0.2, **place}
    physical = [
        values[name.split(".")[1]] if name.startswith("tether.") else fit.values[name]
        for name in free
    ]
    fit = made_fit(0.0, "tether", theta=Parametrization(fit.hypothesis).encode(np.array(physical)))
    state = SimpleNamespace(law=Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4))
    task = SimpleNamespace(level=Level(), robot=fit.robot)
    accepted = (SimpleNamespace(name="tether"),)
    nominal = made_fit(0.0, ratio=100.0)
    return SimpleNamespace(
        task=task,
        state=state,
        nominal=nominal,
        final=fit,
        accepted=accepted,
        misses=None,
        still_misses=None,
    )


def test_a_line_made_fast_outside_the_pool_is_unexplained_and_said_to_be_a_constant_force() -> None:
    inside, outside = diagnosed(), diagnosed(x=4.0, y=-3.0)
    assert [a.name for a in named(inside)] == ["tether"]
    assert verdict(inside) == "missing_physics"
    assert named(outside) == ()
    assert verdict(outside) == "unexplained"
    assert "a constant force in the pool frame" in refused(outside)[0]
