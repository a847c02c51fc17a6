# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The names of a change, their numbers, and the page."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import sem
from swims import World, fish, kinematic_swims, swim

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import fine_delay
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_injection
from fish_sysid.diagnosis.change.change import Change, Member, Named
from fish_sysid.diagnosis.change.change_json import answer
from fish_sysid.diagnosis.change.channels import swims
from fish_sysid.diagnosis.change.compare import LOOKS
from fish_sysid.diagnosis.change.contenders import (
    Case,
    Contender,
    family_alone,
    next_change,
    weighed,
)
from fish_sysid.diagnosis.change.explanation import exact_age, explained, swapped_in, telling
from fish_sysid.diagnosis.change.naming import Judged, apart, judge_all, tie
from fish_sysid.diagnosis.change.permutation_test import (
    largest,
    permutation_p_value,
    rank,
    sets_in_place,
)
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, look, trial_rows
from fish_sysid.diagnosis.change.servos import OldAnswer
from fish_sysid.diagnosis.change.shared_fit import regression
from fish_sysid.diagnosis.change.strength import Refitted, refit
from fish_sysid.diagnosis.change.swap_test import Swapped, at_once, swap_test
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.reports.change_page import side_by_side, write_change_page

NAMES = ("current", "camera_latency", "camera_heading_offset", "gyro_scale", "imu_misalignment")
OLD, NEW, TRIALS = 10, 5, 8
SPREADS = np.array([np.tile([1.0, -1.0], TRIALS // 2), np.repeat([1.0, -1.0], TRIALS // 2)])


def judged(name: str, gain: float, spread: float = 1.0) -> Judged:
    """Gains over trials that go their own way for names of odd and even length."""
    by_trial = gain + spread * SPREADS[len(name) % 2]
    return Judged((name, 0), gain, by_trial, np.ones(1), np.eye(1), gain, 1.0)


def contender(name: str, gain: float, remainder: float, rarity: float = 5.0) -> Contender:
    one = judged(name, gain, 10.0)
    return Contender(one, Refitted({}, "", one.by_trial), remainder, rarity)


def swapped(p_value: float, of_exchanged: np.ndarray, **rarity: float) -> Swapped:
    return Swapped(p_value, rarity, of_exchanged, 0.0)


def names(contenders: list[Contender]) -> list[str]:
    return [one.judged.name for one in contenders]


def test_two_looks_at_the_same_exchanges_cost_one_and_at_independent_ones_two() -> None:
    random = np.random.default_rng(3)
    first, second = random.uniform(size=(2, 400))
    alone = at_once([swapped(0.02, first)])
    same = at_once([swapped(0.02, first), swapped(0.02, first)])
    two = at_once([swapped(0.02, first), swapped(0.6, second)])
    assert alone == pytest.approx(0.02, abs=0.008)
    assert same == alone
    assert two == pytest.approx(0.04, abs=0.015)


def test_a_day_of_old_that_looks_as_changed_counts_in_both_looks_together() -> None:
    null = np.random.default_rng(4).uniform(size=300)
    assert at_once([replace(swapped(0.001, null), of_days=0.5)]) == 0.5


def test_a_name_that_leaves_nothing_goes_before_one_that_gains_more() -> None:
    found = [contender("camera_scale", 13.0, 0.002), contender("rudder_offset", 8.0, 0.07)]
    assert names(weighed(found)[0]) == ["rudder_offset"]


def test_a_name_that_leaves_nothing_and_predicts_clearly_worse_does_not() -> None:
    found = [contender("payload", 40.0, 0.002), contender("tether", 8.0, 0.07)]
    assert names(weighed(found)[0]) == ["payload"]


def test_kin_that_leaves_something_stays_in_the_family_with_less_weight() -> None:
    whole = contender("wake_memory", 23.0, 0.03)
    ratios = []
    for remainder in (0.004, 0.002):
        alike, (first, second) = weighed([whole, contender("tail_hardening", 20.0, remainder)])
        assert names(alike) == ["wake_memory", "tail_hardening"]
        ratios.append(second / first)
    assert ratios[1] == pytest.approx(0.5 * ratios[0])
    tip = contender("tip_slip", 23.0, 0.03)
    assert names(weighed([tip, contender("wake_memory", 23.0, 0.002)])[0]) == ["tip_slip"]


def test_of_names_that_predict_as_well_the_rarer_one_is_first() -> None:
    found = [
        contender("hull_asymmetry", 10.0, 0.001, 6.7),
        contender("rudder_offset", 9.0, 0.001, 8.0),
    ]
    alike, weights = weighed(found)
    assert names(alike) == ["rudder_offset", "hull_asymmetry"]
    assert sum(weights) == pytest.approx(1.0)


def test_names_are_compared_by_what_they_gain_before_their_dispersion_is_divided_out() -> None:
    """OLD's trials differ more along the one name than along the other: its gain is less sure, and no smaller."""
    calm = contender("hull_asymmetry", 48.0, 0.4)
    lively = contender("camera_heading_offset", 16.0, 0.2)
    lively = replace(lively, judged=replace(lively.judged, dispersion=3.0))
    assert set(names(weighed([calm, lively])[0])) == {"hull_asymmetry", "camera_heading_offset"}
    lively = replace(lively, judged=replace(lively.judged, dispersion=1.0))
    assert names(weighed([calm, lively])[0]) == ["hull_asymmetry"]


@pytest.mark.parametrize(("trials", "asked"), [(3, 4.527), (9, 2.366), (1000, 2.003)])
def test_few_trials_ask_for_a_larger_lead(trials, asked) -> None:
    """A lead in standard errors that are estimated from the trials: Student's t at the level of two normal ones."""
    even, spread = np.zeros(trials), np.linspace(-1.0, 1.0, trials)
    ahead = spread / sem(spread)
    assert not apart(ahead + 0.99 * asked, even)
    assert apart(ahead + 1.01 * asked, even)
    assert tie(ahead + asked, even) == pytest.approx(0.0455, rel=0.01)
    assert tie(even, even) == 1.0


def test_what_explains_as_much_and_cannot_be_makes_the_best_name_unsure() -> None:
    best = contender("dry_friction", 6.0, 0.4, 6.0)
    as_good = contender("rotor_lag", 5.9, 0.0, 8.0)
    worse = contender("imu_latency", -40.0, 0.0, 8.0)
    alike, (sure,) = weighed([best], [worse])
    _, (unsure,) = weighed([best], [as_good])
    assert names(alike) == ["dry_friction"]
    assert sure == 1.0
    assert unsure < 0.3
    tip, wake = contender("tip_slip", 6.0, 0.4), contender("wake_memory", 6.0, 0.0)
    assert weighed([tip], [wake])[1] == [1.0]


def test_a_family_is_named_without_numbers_where_its_members_explain_most() -> None:
    rarity = {"tip_slip": 6.7, "wake_memory": 6.7, "payload": 4.0}
    seen = swapped(0.001, np.zeros(1), **rarity)
    found = {n: judged(n, g) for n, g in (("tip_slip", 18.9), ("wake_memory", 18.8))}
    named, _ = family_alone(seen, found) or pytest.fail("no family")
    assert named.family == "tail losses"
    assert [m.name for m in named.members] == ["tip_slip", "wake_memory"]
    assert all(m.refitted.parameters == {} for m in named.members)
    assert math.isclose(sum(m.probability for m in named.members), 0.5)
    assert family_alone(seen, {"payload": judged("payload", 18.9)}) is None
    of_the_fish = {**found, "parameter head_inertia": judged("parameter head_inertia", 60.0)}
    of_its_own = replace(seen, rarity={**rarity, "parameter head_inertia": 9.0})
    assert family_alone(of_its_own, of_the_fish) is None


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("imu_latency", {"delay": -0.004}, "out of its range"),
        ("camera_scale", {"factor": 2.5}, "out of its range"),
        ("imu_latency", {"delay": 0.004}, ""),
    ],
)
def test_a_value_out_of_its_range_is_no_such_effect(name, values, text) -> None:
    said = degenerate(name, values)
    assert text in said
    assert bool(said) == bool(text)


@pytest.fixture(scope="module")
def days():
    return kinematic_swims(World(), 1, OLD), kinematic_swims(World(), 2, NEW)


@pytest.fixture(scope="module")
def looks_at(days):
    """looks_at(new): both looks at a NEW of the same OLD."""
    old, _ = days
    rows_of_old = trial_rows(Robot(), old, swims(old), NAMES)
    answer = OldAnswer.of(rows_of_old)

    def cases(new) -> list[Case]:
        rows = [rows_of_old, trial_rows(Robot(), new, swims(new), NAMES)]
        found = []
        for channels in LOOKS.values():
            kept, moved = (look(r, channels) for r in rows)
            fit, strata = regression(kept, moved), [0] * (OLD + NEW)
            day_of = [0] * OLD + [1] * NEW
            found.append(
                Case(
                    channels,
                    fit,
                    kept,
                    moved,
                    strata,
                    day_of,
                    Robot(),
                    new,
                    tuple(swims(new)),
                    answer,
                )
            )
        return found

    return cases


def test_two_changes_are_named_one_after_the_other_and_leave_nothing(days, looks_at) -> None:
    _, new = days
    flow = with_injection(new, "current", {"x": 0.03, "y": -0.02})
    looks = looks_at(with_injection(flow, "gyro_scale", {"factor": 1.06}))
    found = explained(Change("changed"), looks, swapped_in(looks, ()))
    assert {named.name for named in found.named} == {"current", "gyro_scale"}
    assert found.remainder_p_value > 0.005
    assert found.suspects == ()


def test_the_strokes_name_what_the_mean_motion_does_not_show(days, looks_at) -> None:
    _, new = days
    turned = looks_at(with_injection(new, "imu_misalignment", {"angle": 0.15}))
    flow = looks_at(with_injection(new, "current", {"x": 0.03, "y": -0.02}))
    case, _, found = telling(turned, swapped_in(turned, ()), ())
    assert max(found.values(), key=lambda one: one.gain).name == "imu_misalignment"
    assert telling(flow, swapped_in(flow, ()), ())[0] is flow[0]
    assert case in turned


def test_the_age_of_images_is_that_of_new_less_that_of_old(days) -> None:
    old, new = (
        with_injection(day, "camera_latency", {"delay": age})
        for day, age in zip(days, (0.025, 0.125), strict=True)
    )
    found = Refitted({"delay": Estimate(0.11, 0.03, "s")}, "", np.ones(NEW))
    named = Named((Member("camera_latency", 1.0, 0.5, found),), "", 1.0, 0.1)
    age, said = exact_age(old, new, named)
    assert age == pytest.approx(0.1, abs=0.003)
    assert said.members[0].refitted.parameters["delay"].value == age
    unknown = replace(old, gyro=np.full_like(old.gyro, np.nan))
    assert exact_age(unknown, new, named) == (0.11, named)
    early = replace(old, gyro=np.roll(old.gyro, 15, axis=0))  # 0.125 s behind its images
    assert exact_age(early, new, named) == (0.11, named)
    assert exact_age(old, early, named) == (0.11, named)


@pytest.mark.parametrize("age", [-0.1, -0.01, 0.0, 0.004, 0.995, 1.05])
def test_an_age_beyond_those_tried_is_not_known(days, age) -> None:
    """An image is older the earlier the gyro's samples come; 0 to 1 s are tried."""
    _, new = days
    late = with_injection(new, "camera_latency", {"delay": age + 0.1})
    found, std = fine_delay(replace(late, gyro=np.roll(late.gyro, 10, axis=0)))
    if 0.0 <= age <= 1.0:
        assert found == pytest.approx(age, abs=0.003)
        assert std < 0.003
    else:
        assert np.isnan(found)


def test_what_old_s_days_differ_by_is_no_remainder_of_a_name() -> None:
    """A marker that sits otherwise on OLD's first day differs more from the rest than it does on NEW, where a flow comes too."""

    def turned(experiment: Experiment, offset: float) -> Experiment:
        return with_injection(experiment, "camera_heading_offset", {"offset": offset})

    yesterday, today = kinematic_swims(World(), 1, 8, 10.0), kinematic_swims(World(), 2, 4, 10.0)
    new = with_injection(turned(today, 0.06), "current", {"x": 0.05, "y": 0.0})
    names = ("current", "camera_heading_offset")
    first, second, rows = (
        look(trial_rows(Robot(), e, swims(e), names), MEAN_MOTION)
        for e in (turned(yesterday.select(range(4)), -0.12), yesterday.select(range(4, 8)), new)
    )
    old, day_of = [*first, *second], [0] * 4 + [1] * 4 + [2] * 4
    fit, strata = regression(old, rows), [0] * 12
    case = Case(
        MEAN_MOTION, fit, old, rows, strata, day_of, Robot(), new, tuple(swims(new)), OldAnswer.of(old)
    )  # fmt: skip
    seen = swap_test(fit, strata, 100, days=day_of)
    found = next_change(case, seen, judge_all(fit), (), [])
    assert found is not None
    assert [m.name for m in found[0].members] == ["current"]
    assert found[0].members[0].remainder_p_value == 0.5


def test_so_little_of_an_effect_is_not_said(days, looks_at) -> None:
    _, new = days
    for offset, said in ((0.01, True), (0.06, False)):
        changed = with_injection(new, "camera_heading_offset", {"offset": offset})
        case = looks_at(changed)[0]
        seen = telling([case], swapped_in([case], ()), ())[2]["camera_heading_offset"]
        values = refit(case.fit, case.rows, case.robot, case.new, case.days, seen)
        assert values.parameters["offset"].value == pytest.approx(offset, abs=0.004)
        assert ("too little of it" in values.refused) == said


def test_where_nothing_changed_every_rank_is_as_likely_as_any() -> None:
    """All 70 sets of four of eight trials in NEW's place: each rank comes up once, whatever the trials are like."""
    odd = np.random.default_rng(8).standard_t(2, size=8)
    gains = []
    for new in itertools.combinations(range(8), 4):
        sets = sets_in_place([0] * 8, np.array(new), np.random.default_rng(0), 200)
        assert len(sets) == 70
        means = np.array([abs(odd[list(s)].mean()) for s in sets])
        gains.append(rank(means)[0])
    assert np.sort(gains) == pytest.approx(np.arange(1, 71) / 70, abs=1 / 70 + 1e-9)
    assert np.mean(np.array(gains) <= 0.1) <= 0.1


def test_a_set_is_not_compared_with_sets_that_have_most_of_it() -> None:
    gains = 10.0 * np.exp(np.random.default_rng(9).normal(size=(200, 3)))
    gains[:60, 1] *= 8.0  # NEW and those that share most trials with it
    itself = np.eye(200, dtype=bool)
    near = itself.copy()
    near[:60, :60] = True
    assert largest(gains, gains, near)[0] > 2.5 * largest(gains, gains, itself)[0]
    scaled = gains * np.array([1.0, 1e4, 10.0])  # a name's own scale does not count
    assert largest(scaled, scaled, near) == pytest.approx(largest(gains, gains, near))


def test_names_that_do_not_act_in_most_sets_hide_no_change() -> None:
    gains = 10.0 * np.exp(np.random.default_rng(10).normal(size=(200, 4)))
    gains[:, 2], gains[:, 3] = 0.0, np.where(np.arange(200) % 20 == 7, 0.3, 0.0)
    gains[0, 0] = 1e3
    assert rank(largest(gains, gains, np.eye(200, dtype=bool)))[0] == 1 / 200


def test_a_flow_is_the_rarest_of_all_sets_and_nothing_is_not(days, looks_at) -> None:
    _, new = days
    flow = looks_at(with_injection(new, "current", {"x": 0.03, "y": -0.02}))
    same = looks_at(new)
    strata = [0] * (OLD + NEW)
    changed, unchanged = (
        permutation_p_value([c.fit for c in x], strata, 200) for x in (flow, same)
    )
    assert changed == pytest.approx(1 / 201)
    assert unchanged > 0.02
    days = [0] * 5 + [1] * (OLD - 5) + [2] * NEW
    assert permutation_p_value([c.fit for c in flow], strata, 200, days=days) == changed
    assert permutation_p_value([c.fit for c in same], strata, 200, days=days) >= unchanged
    unequal = [0] * (OLD - 1) + [1] + [2] * NEW
    assert permutation_p_value([c.fit for c in flow], strata, 200, days=unequal) == changed


FLOW = {"x": 0.05, "y": 0.0}  # m/s


@pytest.fixture(scope="module")
def change() -> Change:
    """Water that moves in NEW alone, found by the gyro's answer as it were: without a p-value of the rest."""
    values = {k: Estimate(v, 0.001, "m/s") for k, v in FLOW.items()}
    member = Member("current", 1.0, float("nan"), Refitted(values, "", np.zeros(3)))
    return Change(
        "changed", p_value=0.002, look="mean motion", named=(Named((member,), "", 10.0, 1.0),), remainder_p_value=0.4,
        robot=fish(), old=swim(fish(), duration=8.0), new=swim(fish(current=FLOW), duration=8.0, seed=1),
    )  # fmt: skip


def test_the_curves_of_new_follow_it_better_with_the_change(change: Change) -> None:
    figure = side_by_side(change).figure
    surge = [s for s in figure.data if s.yaxis in ("y4", "y5", "y6")]  # of NEW's trials
    measured = np.concatenate([np.array(s.y) for s in surge if s.name == "measured"])
    errors = {}
    for name in ("OLD's model", "with the change"):
        apart = np.concatenate([np.array(s.y) for s in surge if s.name == name]) - measured
        assert np.isfinite(apart).mean() > 0.8
        errors[name] = np.sqrt(np.nanmean(apart**2))
    assert errors["with the change"] < 0.01  # m/s
    assert errors["with the change"] < 0.5 * errors["OLD's model"] < 0.05


def test_a_number_that_is_not_known_is_no_nan_on_the_page(change: Change, tmp_path: Path) -> None:
    write_change_page(tmp_path / "report.html", "today", answer(change), change)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<td>1.00</td><td>–</td>" in page
    assert "<td>nan</td>" not in page
