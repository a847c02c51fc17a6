# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""OLD and NEW of a fish without forces: the stages of the comparison find what was put in, and nothing where nothing was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kinematic_swims import World, kinematic_swims

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import joined
from fish_sysid.dataset.synthetic import INJECTIONS, with_injection
from fish_sysid.diagnosis.change import comparable
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.change_json import (
    answer,
    chance,
    changed_robot,
    sentence,
    with_change,
)
from fish_sysid.diagnosis.change.channels import swims
from fish_sysid.diagnosis.change.compare import compare, days_of
from fish_sysid.diagnosis.change.harmonics import StrokeWeights
from fish_sysid.diagnosis.change.image_age import age_change
from fish_sysid.diagnosis.change.naming import judge_all
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, look, trial_rows
from fish_sysid.diagnosis.change.shared_fit import regression
from fish_sysid.diagnosis.change.swap_test import exchanges, single_days, swap_test

NAMES = ("current", "camera_latency", "camera_heading_offset", "gyro_scale", "imu_misalignment")
OLD, NEW = 10, 5  # trials


@pytest.fixture(scope="module")
def days():
    """OLD's trials and NEW's of the same fish, nothing hidden."""
    return kinematic_swims(World(), 1, OLD), kinematic_swims(World(), 2, NEW)


@pytest.fixture(scope="module")
def compared(days):
    """What the swap test and the names say of NEW with an injection."""
    old, new = days
    rows = look(trial_rows(Robot(), old, swims(old), NAMES), MEAN_MOTION)

    def with_change(name: str = "", **values: float):
        changed = with_injection(new, name, values) if name else new
        fit = regression(
            rows, look(trial_rows(Robot(), changed, swims(changed), NAMES), MEAN_MOTION)
        )
        return swap_test(fit, [0] * (OLD + NEW), 200), judge_all(fit)

    return with_change


def test_nothing_is_found_where_nothing_changed(compared) -> None:
    swapped, _ = compared()
    assert swapped.p_value > 0.01


@pytest.mark.parametrize(
    ("name", "values", "strength"),
    [
        ("current", {"x": 0.03, "y": -0.02}, 1.0),
        ("camera_heading_offset", {"offset": 0.06}, 1.0),
        ("gyro_scale", {"factor": 1.05}, 1.0),
        ("camera_latency", {"delay": 0.05}, 1.0),
    ],
)
def test_what_was_put_in_is_found_with_its_strength(compared, name, values, strength) -> None:
    swapped, judged = compared(name, **values)
    assert swapped.p_value <= 0.01
    assert max(swapped.rarity, key=lambda n: swapped.rarity[n]) == name
    assert judged[name].strengths[0] == pytest.approx(strength, abs=0.25)


def test_amplitudes_at_the_stroke_are_those_of_the_signal() -> None:
    t = DT * np.arange(1200)
    rotor = 60.0 * np.sin(2.0 * np.pi * 1.7 * t)
    weights = StrokeWeights.of(rotor, np.array([4.0, 6.0]))
    gyro = 0.5 * np.cos(2.0 * np.pi * 1.7 * t - 0.4) + 0.2
    ahead = 0.3 * np.cos(4.0 * np.pi * 1.7 * t)
    found = weights.amplitudes(gyro, ahead, 0.0 * t)
    assert np.abs(found[:, 0]) == pytest.approx(0.5, abs=0.01)
    assert np.abs(found[:, 1:3]) == pytest.approx(0.0, abs=0.02)
    assert np.abs(found[:, 3]) == pytest.approx(0.3, abs=0.01)
    assert weights.rotor == pytest.approx(60.0, rel=0.01)
    assert weights.stroke == pytest.approx(2.0 * np.pi * 1.7, rel=0.01)


def test_exchanged_trials_are_never_those_of_new_and_keep_its_kinds() -> None:
    kinds, new = [0, 0, 0, 1, 1, 1, 0, 1], np.array([6, 7])
    found = exchanges(kinds, new, np.random.default_rng(0), 200)
    assert len(found) == 4 * 4 - 1
    assert all(sorted(kinds[i] for i in rows) == [0, 1] for rows in found)


def test_exchanged_sets_share_no_more_trials_with_new_than_random_ones() -> None:
    """Four of twelve share 4/3 in the mean: of 495 sets 70 share none and 224 share one."""
    new = np.array([8, 9, 10, 11])
    found = exchanges([1] * 12, new, np.random.default_rng(0), 294)
    shared = np.array([np.isin(rows, new).sum() for rows in found])
    assert set(shared.tolist()) == {0, 1}
    assert 280 < len(found) <= 294


def test_a_rudder_injection_leaves_the_motion_and_changes_the_log(days) -> None:
    old, _ = days
    rudder = old.commands[..., 1]
    gained = with_injection(old, "rudder_gain", {"factor": 0.8})
    shifted = with_injection(old, "rudder_offset", {"offset": 0.06})
    late = with_injection(old, "rudder_delay", {"delay": 0.1})
    assert gained.commands[..., 1] * 0.8 == pytest.approx(rudder)
    assert shifted.commands[..., 1] + 0.06 == pytest.approx(rudder)
    assert late.commands[:-10, :, 1] == pytest.approx(rudder[10:])
    for changed in (gained, shifted, late):
        assert changed.frames == old.frames
        assert np.array_equal(changed.gyro, old.gyro)
    with pytest.raises(ValueError, match="payload"):
        with_injection(old, "payload", {})
    assert len(INJECTIONS) == 9


def test_days_that_cannot_be_compared_say_why_and_what_is_needed(days) -> None:
    old, new = days
    blind = replace(new, gyro=np.full_like(new.gyro, np.nan))
    degrees = replace(new, commands=new.commands * [1.0, 180.0 / np.pi])
    silent = replace(new, commands=new.commands * [1.0, 0.0])
    straight = kinematic_swims(World(turns=False, speeds=(10.0, 12.0)), 3, 4)
    for other, text in (
        (blind, "same topics"),
        (degrees, "equal units"),
        (silent, "rudder: 0 throughout NEW and not in OLD"),
        (new.select([0, 1]), "expected at least 3"),
        (straight, "programs of OLD"),
    ):
        change = compare(other, [old], Robot())
        assert change.verdict == "not_comparable"
        assert text in change.reason
        assert answer(change)["change"]["verdict"] == "not_comparable"
    few = compare(new.select([0, 1, 2]), [old.select(range(6))], Robot())
    assert "6 usable trials of OLD and 3 of NEW can be exchanged in 84 ways" in few.reason
    assert "expected at least 100" in few.reason


def test_a_trial_that_swims_backwards_is_named_and_left_out(days) -> None:
    old, _ = days
    frames = old.frames[2]
    turned = replace(frames, pose=frames.pose + [0.0, 0.0, np.pi])
    backwards = replace(old, frames=(*old.frames[:2], turned, *old.frames[3:]))
    kept, told = comparable.screened(backwards, "OLD")
    assert len(kept) == OLD - 1
    assert told == ["OLD swim_2: swims backwards in the mean"]
    all_of_them = tuple(replace(f, pose=f.pose + [0.0, 0.0, np.pi]) for f in old.frames)
    change = compare(replace(old, frames=all_of_them), [old], Robot())
    assert "NEW has 0 usable trials" in change.reason
    assert change.left_out == tuple(
        f"NEW swim_{m}: swims backwards in the mean" for m in range(OLD)
    )


def test_a_trial_too_short_for_stroke_means_is_named(days) -> None:
    old, _ = days
    short = replace(old, steps=np.array([150, *old.steps[1:]]))
    kept, told = comparable.screened(short, "NEW")
    assert len(kept) == OLD - 1
    assert told == ["NEW swim_0: too short, or too few images"]


def test_a_change_that_old_makes_from_day_to_day_is_none(days) -> None:
    old, new = days
    flow = {"x": 0.03, "y": -0.02}
    first, second = old.select(range(5)), old.select(range(5, OLD))
    changed = with_injection(new, "current", flow)

    def p_value(*olds) -> float:
        both = [
            look(trial_rows(Robot(), e, swims(e), NAMES), MEAN_MOTION) for e in (*olds, changed)
        ]
        fit = regression([row for rows in both[:-1] for row in rows], both[-1])
        of = days_of(olds, joined(olds).names, NEW)
        return swap_test(fit, [0] * (OLD + NEW), 100, days=of).p_value

    assert p_value(first, second) <= 0.01
    assert p_value(with_injection(first, "current", flow), second) > 0.01
    assert single_days([0, 0, 0, 1], 3) == []


@pytest.mark.parametrize(("before", "after"), [(0.0, 0.5), (0.5, 0.0)])
def test_images_much_older_in_one_day_are_said_before_anything_else(days, before, after) -> None:
    old, new = (
        with_injection(e, "camera_latency", {"delay": age})
        for e, age in zip(days, (before, after), strict=True)
    )
    robot = Robot().with_effect("camera_latency", delay=0.2)  # not of these images
    change = compare(new, [old], robot, fit=False)
    assert change.look == "the images' age"
    assert change.p_value <= 0.01
    assert change.named[0].name == "camera_latency"
    delay = change.named[0].members[0].refitted.parameters["delay"]
    assert delay.value == pytest.approx(after - before, abs=0.01)
    assert changed_robot(change).sensors["camera_latency"]["delay"] == pytest.approx(
        after, abs=0.02
    )
    assert "as well as NEW: images" not in sentence(change)
    assert ("OLD had: images are 0.50 s older" in sentence(change)) == (before > 0.0)


def test_without_a_change_of_the_images_age_the_regression_looks_for_one(days) -> None:
    old, new = days
    assert age_change(old, new) is None
    assert age_change(old, with_injection(new, "camera_latency", {"delay": 0.1})) is None
    blind = replace(new, gyro=np.full_like(new.gyro, np.nan))
    assert age_change(old, blind) is None


def test_kinds_leave_enough_exchanges(days) -> None:
    old, new = days
    few = swims(old)[:6], swims(new)[:3]
    kind = comparable.kinds(*few)
    assert len(kind) == 9
    assert len(set(kind)) == 1  # six and three have 84 exchanges in all


def test_days_are_joined_trial_by_trial(days) -> None:
    old, new = days
    both = joined([old, new])
    assert len(both.names) == len(set(both.names)) == OLD + NEW
    assert np.array_equal(both.commands[: new.length, OLD:], new.commands)


def test_a_change_is_added_to_what_the_robot_has() -> None:
    from fish_sysid.diagnosis.change.change import Member
    from fish_sysid.diagnosis.change.strength import Refitted
    from fish_sysid.diagnosis.symmetry.finding import Estimate

    robot = Robot().with_effect("current", x=0.01, y=0.0)
    values = {"x": Estimate(0.03, 0.001, "m/s"), "y": Estimate(-0.02, 0.001, "m/s")}
    member = Member("current", 1.0, 10.0, 0.5, Refitted(values, "", np.zeros(3)))
    changed = with_change(robot, member)
    assert changed.effects["current"]["x"] == pytest.approx(0.04)
    assert changed.effects["current"]["y"] == pytest.approx(-0.02)
    assert answer(Change("unchanged", p_value=0.4))["verdict"] == "no_mismatch"


def test_a_few_hundred_exchanges_are_not_said_to_show_one_in_millions() -> None:
    assert chance(8.7e-8) == "p < 0.001"
    assert chance(0.0033) == "p = 0.0033"


def test_the_sentence_says_numbers_and_what_is_left() -> None:
    from fish_sysid.diagnosis.change.change import Member, Named
    from fish_sysid.diagnosis.change.strength import Refitted
    from fish_sysid.diagnosis.symmetry.finding import Estimate

    values = {"factor": Estimate(0.71, 0.011, "1")}
    named = Named(
        (Member("rudder_gain", 1.0, 9.0, 0.5, Refitted(values, "", np.zeros(3))),), "", 9.0, 1.0
    )
    change = Change("changed", p_value=0.002, named=(named,), remainder_p_value=0.4)
    assert "rudder_gain (factor 0.71 ± 0.011) (p = 0.002)" in sentence(change)
    assert "looks like exchanged trials (p = 0.4)" in sentence(change)
    hardly = sentence(replace(change, remainder_p_value=0.01))
    assert "more than most exchanged trials show, and too little to be named (p = 0.01)" in hardly
    none = answer(Change("not_comparable", reason="no gyro; record one"))
    assert none["next_experiment"] == {"program": [], "why": "no gyro; record one"}
    assert none["unexplained"]["description"] == "not known: NEW and OLD cannot be compared"


def test_the_standard_error_is_that_of_new_less_old(days) -> None:
    """A marker that sits a little otherwise in every trial: the difference of two means of these offsets is as uncertain."""
    random, (old, new) = np.random.default_rng(5), days
    trials = [e.select([m]) for e in (old, new) for m in range(len(e.names))]
    offsets = random.normal(scale=0.03, size=len(trials))
    rows = []
    for trial, offset in zip(trials, offsets, strict=True):
        moved = with_injection(trial, "camera_heading_offset", {"offset": offset})
        rows += look(
            trial_rows(Robot(), moved, swims(moved), ("camera_heading_offset",)), MEAN_MOTION
        )
    variances = []
    for _ in range(12):
        order = random.permutation(len(rows))
        fit = regression([rows[i] for i in order[NEW:]], [rows[i] for i in order[:NEW]])
        variances.append(judge_all(fit)["camera_heading_offset"].covariance[0, 0])
    typical = 0.06  # rad, unit of a strength
    expected = np.var(offsets / typical, ddof=1) * (1 / OLD + 1 / NEW)
    assert np.mean(variances) == pytest.approx(expected, rel=0.25)
