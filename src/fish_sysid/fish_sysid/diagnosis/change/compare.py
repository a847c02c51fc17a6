# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The method on one page: comparable? rows, permutation test, names, strengths, remainder, and OLD's best model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import align, moved_back
from fish_sysid.dataset.experiment import Experiment, joined
from fish_sysid.dataset.read import LESS
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.channels import Swim, same_trials
from fish_sysid.diagnosis.change.comparable import (
    NotComparableError,
    check_counts,
    check_sensors,
    far_out,
    kinds,
    screened,
)
from fish_sysid.diagnosis.change.contenders import Case
from fish_sysid.diagnosis.change.explanation import NAMES, explained
from fish_sysid.diagnosis.change.image_age import AgeChange, age_change
from fish_sysid.diagnosis.change.permutation_test import permutation_p_value
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, STROKES, look, trial_rows
from fish_sysid.diagnosis.change.rudder_change import (
    RudderChange,
    rudder_change,
    with_second_opinion,
)
from fish_sysid.diagnosis.change.servos import OldAnswer, with_servo
from fish_sysid.diagnosis.change.shared_fit import regression
from fish_sysid.diagnosis.change.swap_test import swap_test
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings
from fish_sysid.diagnosis.symmetry.outcome import in_still_water
from fish_sysid.estimation.parametrization import NOMINAL_FREE
from fish_sysid.estimation.shooting.prediction_fit import quick_robot
from fish_sysid.estimation.shooting.schedule import can_be_predicted

Report = Callable[[str], None]

LOOKS = {"mean motion": MEAN_MOTION, "strokes": STROKES}
LEVEL = 0.01  # of all names in both looks together, and of the rudder's answer: at most 2 % of nulls are called changed


def compare(
    new: Experiment,
    olds: Sequence[Experiment],
    robot: Robot,
    report: Report = lambda _: None,
    fit: bool = True,
) -> Change:
    """What changed in NEW against the days OLD; "not_comparable" with the reason where that cannot be said.

    robot: what the candidates' shapes are simulated with; fit: `Change.robot` is OLD's best model, else this one, for images
    at the moment they were taken: how old OLD's are, camera and gyro say, and the robot only without a gyro.
    """
    given = robot.sensors.get("camera_latency", {}).get("delay", 0.0)
    robot = robot.without_effect("camera_latency")
    try:
        change = _compare(new, olds, robot, given, report)
    except NotComparableError as error:
        return Change("not_comparable", reason=str(error), left_out=error.left_out)
    if fit and change.old is not None:
        report("fitting OLD by predictions")
        return replace(change, robot=model_of(in_still_water(change.old, change.symmetry), robot))
    return change


def _compare(
    new: Experiment,
    olds: Sequence[Experiment],
    robot: Robot,
    given: float,
    report: Report,
) -> Change:
    """The answer with the robot as it is given; given: s, by which its camera is late."""
    old = joined(olds)
    check_sensors(old, new)
    aligned = align(old)
    delay = aligned.delay if np.isfinite(aligned.rms) else given
    report("testing symmetries of OLD")
    symmetry = symmetry_findings(old, robot)
    age = age_change(old, new, days_of(olds, old.names, len(new.names)))
    age = age if age is not None and age.p_value <= LEVEL else None
    later = 0.0 if age is None else age.later
    old, new = moved_back(old, delay), moved_back(new, delay + later)
    old_days, told = screened(old, "OLD")
    new_days, more = screened(new, "NEW")
    check_counts(old_days, new_days, (*told, *more))
    report("the rudder's answer")
    strata = kinds(old_days, new_days)
    old, new = _of(old, old_days), _of(new, new_days)
    day_of = days_of(olds, old.names, len(new.names))
    answer = rudder_change(old, new, strata, day_of)
    servo = answer if answer is not None and answer.p_value <= LEVEL else None
    passed = new
    if servo is not None:
        passed, new_days = _as_passed_on(new, new_days, servo)
    report("what each candidate would change")
    looks = _looks(robot, (old, old_days), (passed, new_days), strata, day_of)
    strange = {
        trial: None
        for case in looks.values()
        for trial in far_out(case.fit.names, case.fit.rest, case.fit.old)
    }
    told += [f"OLD {s}: out of the other trials' family; {LESS}" for s in strange]
    report("exchanging trials")
    tests = {name: swap_test(case.fit, strata, days=day_of) for name, case in looks.items()}
    seen = min(tests, key=lambda name: tests[name].p_value)
    p_value = permutation_p_value([case.fit for case in looks.values()], strata, days=day_of)
    base = Change(
        "unchanged", p_value=p_value, look=seen, left_out=(*told, *more), robot=robot, old=old, new=new,
        camera_delay=delay, symmetry=symmetry, rarities=tests[seen].rarity,
    )  # fmt: skip
    base = _with_what_was_taken_out(base, age, servo)
    if p_value > LEVEL:
        return base
    report("naming what changed")
    found_names = explained(
        replace(base, verdict="changed"), list(looks.values()), list(tests.values())
    )
    if servo is None:
        named = with_second_opinion(found_names.named, answer)
        found_names = replace(found_names, named=tuple(named))
    return found_names


def _with_what_was_taken_out(
    base: Change, age: AgeChange | None, servo: RudderChange | None
) -> Change:
    """The answer with what camera and gyro, and the gyro's answer to the rudder, had said before; the rest is its remainder."""
    first = {"the images' age": age, "the rudder's answer": servo}
    told = {look: one for look, one in first.items() if one is not None}
    if not told:
        return base
    look = next(iter(told))
    return replace(
        base, verdict="changed", p_value=told[look].p_value, look=look, named=tuple(one.named for one in told.values()),
        remainder_p_value=base.p_value,
    )  # fmt: skip


def _looks(
    robot: Robot,
    old: tuple[Experiment, Sequence[Swim]],
    new: tuple[Experiment, tuple[Swim, ...]],
    strata: list[int],
    day_of: list[int],
) -> dict[str, Case]:
    """OLD and NEW in each look; the robot's candidates, and those that OLD's answer to its commands makes."""
    old_rows = trial_rows(robot, *old, NAMES)
    answered = OldAnswer.of(old_rows)
    old_rows = answered.added(old_rows, old[1], old[0])
    new_rows = answered.added(trial_rows(robot, *new, NAMES), new[1], new[0])
    found = {}
    for name, channels in LOOKS.items():
        kept_old, kept_new = look(old_rows, channels), look(new_rows, channels)
        fit = regression(kept_old, kept_new)
        found[name] = Case(channels, fit, kept_old, kept_new, strata, day_of, robot, *new, answered)
    return found


def _of(experiment: Experiment, days: Sequence[Swim]) -> Experiment:
    """The trials of these swims."""
    return experiment.select([experiment.names.index(swim.name) for swim in days])


def _as_passed_on(
    new: Experiment, days: Sequence[Swim], servo: RudderChange
) -> tuple[Experiment, tuple[Swim, ...]]:
    """NEW with its commands as the changed servo passed them on, and the swims of these trials."""
    first = servo.named.members[0]
    (value,) = first.refitted.parameters.values()
    passed = with_servo(new, first.name, value.value)
    return passed, same_trials(days, passed)


def days_of(olds: Sequence[Experiment], kept: Sequence[str], new: int) -> list[int]:
    """The day of each of OLD's kept trials, in the order of `joined`, and one more day for `new` trials of NEW."""
    counts = [len(day.names) for day in olds]
    numbers = dict(zip(joined(olds).names, np.repeat(np.arange(len(olds)), counts), strict=True))
    return [int(numbers[name]) for name in kept] + [len(olds)] * new


def model_of(old: Experiment, robot: Robot) -> Robot:
    """A robot that predicts OLD well; the given one where no trial is long enough."""
    if not can_be_predicted(old):
        return robot
    return quick_robot(old, robot, NOMINAL_FREE).without_effect("disturbance")
