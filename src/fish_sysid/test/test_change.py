# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What changed between two days: comparison, null, shapes of the candidates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher
from swims import World, kinematic_swims

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import fine_delay
from fish_sysid.dataset.experiment import Experiment, Frames, joined
from fish_sysid.dataset.synthetic import INJECTIONS, with_injection
from fish_sysid.diagnosis.change import comparable
from fish_sysid.diagnosis.change.candidates import COLUMNS
from fish_sysid.diagnosis.change.change import Change, Member, Named
from fish_sysid.diagnosis.change.change_json import (
    answer,
    chance,
    changed_robot,
    sentence,
    with_change,
)
from fish_sysid.diagnosis.change.channels import StrokeWeights, swims
from fish_sysid.diagnosis.change.compare import LOOKS, compare, days_of
from fish_sysid.diagnosis.change.contenders import Case
from fish_sysid.diagnosis.change.explanation import explained, swapped_in
from fish_sysid.diagnosis.change.image_age import age_change
from fish_sysid.diagnosis.change.naming import judge_all
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, look, trial_rows
from fish_sysid.diagnosis.change.rudder_change import (
    RudderChange,
    rudder_change,
    step_response,
    with_second_opinion,
)
from fish_sysid.diagnosis.change.servos import (
    ANSWERED,
    FORM,
    OldAnswer,
    delayed,
    lagged,
    with_play,
    with_servo,
)
from fish_sysid.diagnosis.change.shared_fit import regression
from fish_sysid.diagnosis.change.simulation import AFTER, BEFORE, rollout
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.change.swap_test import (
    Gains,
    Tails,
    exchanges,
    single_days,
    swap_test,
    tail_probability,
)
from fish_sysid.diagnosis.vocabulary import family_of
from fish_sysid.estimation.ekf import filter_stepper

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


@pytest.mark.parametrize("with_gyro", [True, False])
def test_older_images_show_an_older_yaw_rate_where_no_gyro_tells_it(days, with_gyro) -> None:
    _, new = days
    seen = new if with_gyro else replace(new, gyro=np.full_like(new.gyro, np.nan))
    aged = with_injection(seen, "camera_latency", {"delay": 0.05})  # the typical one
    changes, columns = [], []
    for before, after in zip(swims(seen), swims(aged), strict=True):
        rate = before.channel == 2
        changes.append((after.measured() - before.measured())[rate])
        columns.append(COLUMNS["camera_latency"](before)[rate, 0])
    change, column = np.concatenate(changes), np.concatenate(columns)
    if with_gyro:
        assert not column.any()
    else:
        assert change @ column / (column @ column) == pytest.approx(1.0, abs=0.1)


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


@pytest.mark.parametrize(("before", "after"), [(0.5, 0.0), (0.015, 0.5)])
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
    assert ("OLD had: images are 0.50 s older" in sentence(change)) == (before == 0.5)
    # what is compared from then on is equally old in both: also where OLD's age is too small to be moved back
    assert fine_delay(change.new)[0] == pytest.approx(fine_delay(change.old)[0], abs=0.003)


def test_without_a_change_of_the_images_age_the_regression_looks_for_one(days) -> None:
    old, new = days
    assert age_change(old, new) is None
    assert age_change(old, with_injection(new, "camera_latency", {"delay": 0.1})) is None
    blind = replace(new, gyro=np.full_like(new.gyro, np.nan))
    assert age_change(old, blind) is None


def test_images_whose_age_differs_as_much_from_day_to_day_are_no_change(days) -> None:
    """Images of OLD's first day are 0.1 s old and those of its second 0.5 s, those of NEW 0.7 s."""
    old, new = days
    first, second, aged = (
        with_injection(e, "camera_latency", {"delay": age})
        for e, age in ((old.select(range(5)), 0.1), (old.select(range(5, OLD)), 0.5), (new, 0.7))
    )
    both = joined([first, second])
    one_day, two_days = (
        age_change(both, aged, day_of) for day_of in ((), [0] * 5 + [1] * 5 + [2] * NEW)
    )
    assert one_day is not None
    assert two_days is not None
    assert one_day.p_value <= 0.01
    assert two_days.p_value == 0.5


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
    member = Member("current", 1.0, 0.5, Refitted(values, "", np.zeros(3)))
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
        (Member("rudder_gain", 1.0, 0.5, Refitted(values, "", np.zeros(3))),), "", 9.0, 1.0
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


JUMP = 300  # grid point at which the rotor jumps


@pytest.fixture(scope="module")
def driven():
    """Two equal fish, the second with a rotor that jumps as no motor can."""
    stepper = filter_stepper(Robot())
    t = DT * np.arange(900)
    commands = np.zeros((len(t), 2, 2))
    commands[:, :, 0] = 40.0 * np.sin(4.0 * np.pi * t)[:, None]
    commands[JUMP : JUMP + 6, 1, 0] = (4e4, -4e4, 4e4, -4e4, 4e4, -4e4)
    table = np.repeat(stepper.parameters(Robot())[None], 2, axis=0)
    return *rollout(stepper, table, commands), stepper.layout.links + 3


def test_the_trial_goes_on_where_it_diverged(driven) -> None:
    x, lost, turn = driven
    assert np.isfinite(x[:-1]).all()
    again = JUMP + round((AFTER + 1.0) / DT)
    assert x[again:-1, 1, turn].mean() == pytest.approx(x[again:-1, 0, turn].mean(), rel=0.1)
    assert lost[JUMP - round(BEFORE / DT) + 10 : JUMP + round(AFTER / DT), 1].all()


def test_what_diverges_after_every_restart_says_nothing(driven) -> None:
    _, _, turn = driven
    stepper = filter_stepper(Robot())
    commands = np.zeros((900, 1, 2))
    for k in range(100, 880, 60):  # thirteen jumps of the rotor
        commands[k : k + 6, 0, 0] = (4e4, -4e4, 4e4, -4e4, 4e4, -4e4)
    x, lost = rollout(stepper, stepper.parameters(Robot())[None], commands)
    gone = ~np.isfinite(x[:-1, 0, turn])
    assert gone.any()
    assert lost[int(gone.argmax()) - 100 : -1, 0].all()


def test_its_neighbour_is_as_without_it(driven) -> None:
    _, lost, _ = driven
    assert not lost[:, 0].any()


SERVO_NAMES = ("current", "camera_scale", "camera_heading_offset", "rudder_offset", "rudder_gain")
COMMANDED_OLD, COMMANDED_NEW = 12, 6  # trials


@pytest.fixture(scope="module")
def commanded_days() -> tuple[Experiment, Experiment]:
    return kinematic_swims(World(), 1, COMMANDED_OLD), kinematic_swims(World(), 2, COMMANDED_NEW)


@pytest.fixture(scope="module")
def looks_at(commanded_days):
    """looks_at(new): both looks at a NEW of the same OLD."""
    old, _ = commanded_days
    rows_of_old = trial_rows(Robot(), old, swims(old), SERVO_NAMES)
    answer = OldAnswer.of(rows_of_old)
    both = answer.added(rows_of_old, swims(old), old)

    def cases(new: Experiment) -> list[Case]:
        moved = answer.added(trial_rows(Robot(), new, swims(new), SERVO_NAMES), swims(new), new)
        found = []
        for channels in LOOKS.values():
            kept, cut = look(both, channels), look(moved, channels)
            fit, strata, day_of = (
                regression(kept, cut),
                [0] * (COMMANDED_OLD + COMMANDED_NEW),
                [0] * COMMANDED_OLD + [1] * COMMANDED_NEW,
            )
            days_of_new = tuple(swims(new))
            found.append(
                Case(channels, fit, kept, cut, strata, day_of, Robot(), new, days_of_new, answer)
            )
        return found

    return cases


@pytest.mark.parametrize(("name", "value"), [("rudder_offset", 0.06), ("rudder_gain", 0.8)])
def test_the_column_is_what_a_fish_of_another_structure_does(
    commanded_days, looks_at, name, value
) -> None:
    _, new = commanded_days
    key = {"rudder_offset": "offset", "rudder_gain": "factor"}[name]
    case = looks_at(with_injection(new, name, {key: value}))[0]
    judged = judge_all(case.fit)
    assert judged[name].key == (name, FORM)
    assert judged[name].strengths[0] == pytest.approx(1.0, abs=0.2)
    assert judged[name].gain == max(one.gain for one in judged.values())


def test_another_zero_of_the_servo_is_named_with_its_number(commanded_days, looks_at) -> None:
    _, new = commanded_days
    looks = looks_at(with_injection(new, "rudder_offset", {"offset": -0.05}))
    found = explained(Change("changed"), looks, swapped_in(looks, ()))
    (named,) = found.named
    offset = named.members[0].refitted.parameters["offset"]
    assert named.name == "rudder_offset"
    assert offset.value == pytest.approx(-0.05, abs=3.0 * offset.std)
    assert offset.std < 0.01
    assert found.remainder_p_value > 0.005


def test_what_differs_from_trial_to_trial_weighs_less(commanded_days) -> None:
    """A camera's scale that is drawn for every trial: it gains as little as the trials' own differences let it."""
    random = np.random.default_rng(5)
    old, new = (_scaled_trial_by_trial(day, random) for day in commanded_days)
    gained = {}
    for case, (yesterday, today) in {"varied": (old, new), "equal": commanded_days}.items():
        rows = [
            look(trial_rows(Robot(), day, swims(day), SERVO_NAMES), MEAN_MOTION)
            for day in (yesterday, today)
        ]
        fit = regression(*rows)
        gained[case] = Gains(fit, ()).dispersion(), judge_all(fit)
    varied, equal = gained["varied"][0], gained["equal"][0]
    assert varied["camera_scale", 0] > 5.0 * equal["camera_scale", 0]
    assert varied["camera_heading_offset", 0] < 0.5 * varied["camera_scale", 0]
    one = gained["varied"][1]["camera_scale"]
    assert one.dispersion == varied["camera_scale", 0]
    assert one.gain < 3.0


def _scaled_trial_by_trial(day: Experiment, random: np.random.Generator) -> Experiment:
    parts = [
        with_injection(day.select([m]), "camera_scale", {"factor": 1.0 + 0.1 * random.normal()})
        for m in range(len(day.names))
    ]
    frames = tuple(part.frames[0] for part in parts)
    return Experiment(
        day.names, day.steps, day.commands, day.gyro, day.accel, day.encoder, frames=frames,
        start_at_rest=False,
    )  # fmt: skip


STEPPED_OLD, STEPPED_NEW, STEPS = 8, 5, 1000
STRATA = [0] * (STEPPED_OLD + STEPPED_NEW)
LEVEL = 0.02


def swum(seed: int, count: int) -> Experiment:
    """A body that answers rotor and a rudder of random steps with a lag of 0.15 s, and a gyro with noise."""
    random = np.random.default_rng(seed)
    t = DT * np.arange(STEPS)
    commands, gyro = np.zeros((STEPS, count, 2)), np.zeros((STEPS, count))
    for m in range(count):
        rotor = random.uniform(40.0, 70.0) * np.sin(4.0 * np.pi * t + random.uniform(0.0, 6.0))
        rudder = np.repeat(random.uniform(-0.4, 0.4, STEPS // 50), 50)
        commands[:, m] = np.column_stack([rotor, rudder])
        push = 0.03 * rudder * np.sqrt(lagged(rotor**2, 0.5)) + 0.01 * rotor
        gyro[:, m] = lagged(push, 0.15) + 0.02 * random.standard_normal(STEPS)
    frames = tuple(Frames(t[::5], np.zeros((len(t[::5]), 3))) for _ in range(count))
    names = tuple(f"{seed}_{m}" for m in range(count))
    nothing = np.full((STEPS, count), np.nan)
    return Experiment(
        names, np.full(count, STEPS), commands, gyro, np.full((STEPS, count, 2), np.nan), nothing, frames, True
    )  # fmt: skip


@pytest.fixture(scope="module")
def stepped_days() -> tuple[Experiment, Experiment]:
    return swum(1, STEPPED_OLD), swum(2, STEPPED_NEW)


def test_nothing_changed(stepped_days) -> None:
    answer = step_response(*stepped_days, STRATA, 150)
    assert answer is not None
    assert answer.p_value > LEVEL
    change = rudder_change(*stepped_days, STRATA)
    assert change is None or change.p_value > LEVEL


@pytest.mark.parametrize(
    ("name", "values", "tolerance"),
    [("rudder_delay", {"delay": 0.085}, 0.01), ("rudder_gain", {"factor": 0.8}, 0.03)],
)
def test_an_injection_is_named_with_its_number(stepped_days, name, values, tolerance) -> None:
    old, new = stepped_days
    change = rudder_change(old, with_injection(new, name, values), STRATA)
    assert change is not None
    assert change.p_value < LEVEL
    assert change.named.name == name
    assert change.named.family == "rudder timing"
    ((key, value),) = values.items()
    found = change.named.members[0].refitted.parameters[key]
    assert found.value == pytest.approx(value, abs=tolerance)


def test_a_servo_that_differs_as_much_from_day_to_day_is_no_change(stepped_days) -> None:
    """OLD's first day has a gain of 0.6 and its second of 1.0, NEW has 1.2."""
    old, new = stepped_days
    first = with_injection(old.select(range(4)), "rudder_gain", {"factor": 0.6})
    both = joined([first, old.select(range(4, STEPPED_OLD))])
    stronger = with_injection(new, "rudder_gain", {"factor": 1.2})
    one_day, two_days = (
        step_response(both, stronger, STRATA, 60, days=days)
        for days in ((), [0] * 4 + [1] * 4 + [2] * STEPPED_NEW)
    )
    assert one_day is not None
    assert two_days is not None
    assert one_day.p_value < LEVEL
    assert two_days.p_value == 0.5


def test_a_lag_is_told_from_a_delay(stepped_days) -> None:
    """The command is what a servo with a lag of 0.12 s would have had to get."""
    old, new = stepped_days
    kept = np.exp(-DT / 0.12)
    rudder = new.commands[..., 1]
    led = rudder.copy()
    led[1:] = (rudder[1:] - kept * rudder[:-1]) / (1.0 - kept)
    change = rudder_change(
        old, replace(new, commands=np.stack([new.commands[..., 0], led], axis=-1)), STRATA
    )
    assert change is not None
    assert change.p_value < LEVEL
    assert [m.name for m in change.named.members] == ["rudder_lag"]
    assert change.named.members[0].refitted.parameters["time_constant"].value == pytest.approx(
        0.12, abs=0.01
    )


def test_servos_do_to_a_step_what_their_names_say() -> None:
    step = np.where(DT * np.arange(200) < 1.0, 0.0, 0.3)
    assert lagged(step, 0.1)[110] == pytest.approx(0.3 * (1.0 - np.exp(-1.1)), abs=0.002)
    assert delayed(step, 0.1)[108] == 0.0
    assert delayed(step, 0.1)[112] == pytest.approx(0.3)
    assert with_play(step, 0.05)[150] == pytest.approx(0.25)
    with pytest.raises(KeyError):
        with_servo(swum(1, 1), "payload", 0.1)
    assert set(ANSWERED) == {"rudder_lag", "rudder_delay", "rudder_backlash", "rudder_gain"}


def test_without_a_gyro_there_is_no_answer(stepped_days) -> None:
    old, new = stepped_days
    assert step_response(old, replace(new, gyro=np.full_like(new.gyro, np.nan)), STRATA) is None


@pytest.mark.parametrize("phase", [0, 1])
def test_a_gyro_of_every_other_grid_point_answers_on_odd_ones_too(stepped_days, phase) -> None:
    """A full one is read at even ones: the answer is the same there, and about the same between them."""
    old, new = stepped_days
    late = with_injection(new, "rudder_delay", {"delay": 0.085})
    full = step_response(old, late, STRATA, 20)
    slow = [replace(e, gyro=e.gyro.copy()) for e in (old, late)]
    for e in slow:
        e.gyro[1 - phase :: 2] = np.nan
    answer = step_response(*slow, STRATA, 20)
    assert answer is not None
    assert full is not None
    assert answer.servos[0].name == "rudder_delay"
    assert answer.servos[0].gains == pytest.approx(full.servos[0].gains, rel=0.1 * phase)
    assert answer.servos[0].estimate.value == pytest.approx(0.085, abs=0.01)


def test_a_trial_without_a_gyro_is_left_out_while_enough_remain(stepped_days) -> None:
    old, new = stepped_days
    late = with_injection(new, "rudder_delay", {"delay": 0.085})
    silent = [replace(e, gyro=e.gyro.copy()) for e in (old, late)]
    for e in silent:
        e.gyro[:, 0] = np.nan
    answer = step_response(*silent, STRATA, 150)
    rest = [e.select(range(1, len(e.names))) for e in (old, late)]
    expected = step_response(*rest, STRATA[2:], 150)
    assert answer is not None
    assert expected is not None
    assert answer.p_value == expected.p_value < LEVEL
    assert answer.servos[0].estimate == expected.servos[0].estimate
    silent[1].gyro[:, :3] = np.nan
    assert step_response(*silent, STRATA, 150) is None


def test_the_gyro_has_a_second_opinion_on_timing_alone() -> None:
    """The mean motion says placement, the gyro lag. The gyro says nothing of a flow."""
    by_motion = _named("rudder_placement", rudder_placement=0.7, rudder_delay=0.3)
    flow = _named("current", current=1.0)
    by_gyro = RudderChange(0.03, _named("rudder_lag", 2.0, rudder_lag=0.9, rudder_delay=0.1))
    timing, same = with_second_opinion([by_motion, flow], by_gyro)
    assert {m.name: m.probability for m in timing.members} == pytest.approx(
        {"rudder_lag": 0.45, "rudder_placement": 0.35, "rudder_delay": 0.2}
    )
    assert timing.name == "rudder_lag"
    assert (timing.family, timing.gain) == ("rudder timing", 2.0)
    assert same is flow
    unsure = RudderChange(0.3, by_gyro.named)
    assert with_second_opinion([by_motion], unsure) == [by_motion]


def _named(first: str, gain: float = 1.0, **members: float) -> Named:
    none = Refitted({}, "", np.full(3, gain))
    made = tuple(Member(name, p, 0.5, none) for name, p in members.items())
    return Named(made, family_of(first), gain, 0.1)


def test_a_number_at_an_end_of_those_tried_is_not_said_to_be_exact() -> None:
    old, new = (
        swum(1, STEPPED_OLD),
        with_injection(swum(2, STEPPED_NEW), "rudder_gain", {"factor": 0.4}),
    )
    answer = step_response(old, new, STRATA, 20)
    assert answer is not None
    gain = next(servo for servo in answer.servos if servo.name == "rudder_gain").estimate
    assert gain.value == pytest.approx(0.5)  # the least that is tried
    assert gain.std == pytest.approx(0.1 / 12**0.5)


DEGREES = (1, 10)


def test_the_tail_of_an_f_statistic_is_found_beyond_its_largest_value() -> None:
    """300 values reach to 0.003; a probability of 0.0003 is found to be small, and never much too small."""
    random = np.random.default_rng(3)
    value = float(fisher.isf(3e-4, *DEGREES))
    found = np.array([tail_probability(random.f(*DEGREES, 300), value) for _ in range(40)])
    assert (found > 3e-4 / 6).all()
    assert (found < 0.02).all()
    assert np.exp(np.log(found).mean()) > 3e-4


def test_within_the_null_it_counts() -> None:
    null = np.arange(1.0, 101.0)
    assert tail_probability(null, 50.5) == pytest.approx(51 / 101)
    assert tail_probability(null, 0.5) == 1.0


def test_a_tail_is_never_lighter_than_the_median_one() -> None:
    random = np.random.default_rng(4)
    null = np.column_stack(
        [random.f(*DEGREES, 300), random.f(*DEGREES, 300), 1.0 + random.random(300)]
    )
    tails = Tails.of(null)
    assert tails.gamma.min() == np.median(tails.gamma)


def test_too_few_exchanged_sets_say_so() -> None:
    with pytest.raises(ValueError, match="null of 8 values"):
        tail_probability(np.ones(8), 2.0)
