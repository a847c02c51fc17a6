# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The method on one page: comparable? a model of OLD, rows, swap test, names, strengths, remainder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.camera_time_offset import align, fine_delay, moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.joined import joined
from fish_sysid.diagnosis.change.candidates import COLUMNS, PARAMETER, POOL_AND_SENSORS, SIMULATED
from fish_sysid.diagnosis.change.change import Change, Member, Named
from fish_sysid.diagnosis.change.channels import Swim, swims
from fish_sysid.diagnosis.change.comparable import (
    NotComparableError,
    check_counts,
    check_sensors,
    far_out,
    kinds,
    screened,
)
from fish_sysid.diagnosis.change.contest import apart, mean_gain, tie
from fish_sysid.diagnosis.change.naming import Judged, judge_all
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, STROKES, TrialRows, look, trial_rows
from fish_sysid.diagnosis.change.rudder_change import (
    RudderChange,
    rudder_change,
    with_second_opinion,
)
from fish_sysid.diagnosis.change.servos import with_servo
from fish_sysid.diagnosis.change.shared_fit import Key, Regression, regression
from fish_sysid.diagnosis.change.strength import Refitted, refit
from fish_sysid.diagnosis.change.swap_test import Swapped, swap_test
from fish_sysid.diagnosis.families import family_of
from fish_sysid.diagnosis.symmetry.applied import in_still_water
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings
from fish_sysid.estimation.parametrization import NOMINAL_FREE
from fish_sysid.estimation.shooting.prediction_fit import quick_robot
from fish_sysid.estimation.shooting.schedule import can_be_predicted

Array = NDArray[np.float64]
Report = Callable[[str], None]

LOOKS = {"mean motion": MEAN_MOTION, "strokes": STROKES}
LEVEL, LEVEL_OF_ANSWER = (
    0.005,
    0.01,
)  # of each of the two looks, of the rudder's answer: at most 2 % of nulls
MOST_CHANGES = 3
CONTENDS = 0.5  # of the largest - log p of a name that a contender has
REFITTED = 3  # contenders of any family
# a name whose special case explains as much is not needed
SPECIAL_CASE = {"nonuniform_current": "current", "wake_memory": "tip_slip"}
KIN = 6  # further members of the best one's family
SUSPECTS = 4  # of a remainder without a name
FEW_SWAPS = 150  # of a member's remainder
NAMES = tuple(dict.fromkeys((*POOL_AND_SENSORS, *COLUMNS, *SIMULATED)))


@dataclass(frozen=True)
class _Case:
    """OLD and NEW in one look."""

    channels: tuple[int, ...]
    fit: Regression
    old: list[TrialRows]
    rows: list[TrialRows]  # of NEW
    strata: list[int]
    day_of: list[int]  # of each trial
    robot: Robot
    new: Experiment
    days: tuple[Swim, ...]  # of NEW


def compare(
    new: Experiment,
    olds: Sequence[Experiment],
    robot: Robot,
    report: Report = lambda _: None,
    make_model: Callable[[Experiment, Robot], Robot] | None = None,
) -> Change:
    """What changed in NEW against the days OLD; "not_comparable" with the reason where that cannot be said.

    make_model: OLD's trials and the robot as given -> the robot whose columns are taken; None: `model_of`.
    """
    try:
        return _compare(new, olds, robot, report, make_model or model_of)
    except NotComparableError as error:
        return Change("not_comparable", reason=str(error))


def _compare(
    new: Experiment,
    olds: Sequence[Experiment],
    robot: Robot,
    report: Report,
    make_model: Callable[[Experiment, Robot], Robot],
) -> Change:
    old = joined(olds)
    check_sensors(old, new)
    delay = align(old).delay
    report("testing symmetries of OLD")
    symmetry = symmetry_findings(old, robot)
    old, new = moved_back(old, delay), moved_back(new, delay)
    old_days, told = screened(swims(old), "OLD")
    new_days, more = screened(swims(new), "NEW")
    check_counts(old_days, new_days)
    report("the rudder's answer")
    strata = kinds(old_days, new_days)
    used, moved = _of(old, old_days), _of(new, new_days)
    answer = rudder_change(used, moved, strata)
    servo = answer if answer is not None and answer.p_value <= LEVEL_OF_ANSWER else None
    if servo is not None:
        new, new_days = _as_passed_on(new, new_days, servo)
    report("fitting OLD by predictions")
    model = make_model(in_still_water(used, symmetry), robot)
    report("what each candidate would change")
    old_rows = trial_rows(model, old, old_days, NAMES)
    new_rows = trial_rows(model, new, new_days, NAMES)
    report("exchanging trials")
    found: dict[str, tuple[_Case, Swapped]] = {}
    day_of = days_of(olds, [s.name for s in old_days], len(new_days))
    for name, channels in LOOKS.items():
        kept_old, kept_new = look(old_rows, channels), look(new_rows, channels)
        fit = regression(kept_old, kept_new)
        strange = far_out(fit.names, fit.rest, fit.old)
        told += [
            f"OLD {s}: out of the other trials' family" for s in strange if s not in " ".join(told)
        ]
        case = _Case(channels, fit, kept_old, kept_new, strata, day_of, model, new, new_days)
        found[name] = case, swap_test(fit, strata, days=day_of)
        if found[name][1].p_value <= LEVEL:
            break
    seen = min(found, key=lambda name: found[name][1].p_value)
    case, swapped = found[seen]
    base = Change(
        "unchanged", p_value=swapped.p_value, look=seen, left_out=(*told, *more), robot=model, old=old, new=new,
        camera_delay=delay, symmetry=symmetry, rarities=swapped.rarity,
    )  # fmt: skip
    if servo is not None:
        base = replace(
            base, verdict="changed", p_value=servo.p_value, look="the rudder's answer", named=(servo.named,),
            remainder_p_value=swapped.p_value,
        )  # fmt: skip
    if swapped.p_value > LEVEL:
        return base
    report("naming what changed")
    found_names = _named(replace(base, verdict="changed"), case, swapped)
    if servo is None:
        named = with_second_opinion(found_names.named, answer)
        found_names = replace(found_names, named=tuple(named))
    return found_names


def _of(experiment: Experiment, days: Sequence[Swim]) -> Experiment:
    """The trials of these swims."""
    return experiment.select([experiment.names.index(swim.name) for swim in days])


def _as_passed_on(
    new: Experiment, days: Sequence[Swim], servo: RudderChange
) -> tuple[Experiment, tuple[Swim, ...]]:
    """NEW with its commands as the changed servo passed them on, and the swims of these trials."""
    first = servo.named.members[0]
    (value,) = first.refitted.parameters.values()
    kept = {swim.name for swim in days}
    passed = with_servo(new, first.name, value.value)
    return passed, tuple(swim for swim in swims(passed) if swim.name in kept)


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


def _named(change: Change, case: _Case, swapped: Swapped) -> Change:
    """Names one at a time, until what is left looks like exchanged trials. An age of the images is taken out exactly."""
    taken: list[Key] = []
    named = list(change.named)
    refused: list[str] = []
    for _ in range(MOST_CHANGES):
        if swapped.p_value > LEVEL:
            break
        answer = _next(case, swapped, taken, refused)
        if answer is None:
            break
        one, key = answer
        if one.name == "camera_latency":
            age, one = exact_age(case.new, one)
            case = _younger(case, age)
        else:
            taken.append(key)
        named = merged(named, one)
        swapped = swap_test(case.fit, case.strata, taken=taken, days=case.day_of)
    named, taken, swapped = needed(case, named, taken, swapped)
    left = swapped.p_value <= LEVEL
    suspects = sorted(swapped.rarity, key=lambda n: -swapped.rarity[n])[:SUSPECTS] if left else []
    return replace(
        change,
        named=tuple(named),
        remainder_p_value=swapped.p_value,
        suspects=tuple(suspects),
        refused=tuple(refused),
    )


def needed(
    case: _Case, named: list[Named], taken: list[Key], swapped: Swapped
) -> tuple[list[Named], list[Key], Swapped]:
    """The changes without those that the later ones make superfluous."""
    for key in list(taken[:-1]):
        others = [k for k in taken if k != key]
        without = swap_test(case.fit, case.strata, taken=others, days=case.day_of)
        if min(without.p_value, swapped.p_value) > LEVEL:
            taken, swapped = others, without
            named = [n for n in named if n.name != key[0]]
    return named, taken, swapped


def merged(named: Sequence[Named], one: Named) -> list[Named]:
    """The changes with one more; of one family there is one, whose members explain it together or in turn."""
    for i, other in enumerate(named):
        if other.family and other.family == one.family:
            had = {m.name for m in other.members}
            more = tuple(m for m in one.members if m.name not in had)
            return [*named[:i], replace(other, members=other.members + more), *named[i + 1 :]]
    return [*named, one]


def exact_age(new: Experiment, one: Named) -> tuple[float, Named]:
    """How much older NEW's images are than OLD's, by camera and gyro, and the change with that number."""
    first = one.members[0]
    value, std = fine_delay(new)
    if not value > 0.0:
        return first.refitted.parameters["delay"].value, one
    values = replace(first.refitted, parameters={"delay": Estimate(value, std, "s")})
    return value, replace(one, members=(replace(first, refitted=values), *one.members[1:]))


def _younger(case: _Case, age: float) -> _Case:
    """The case with NEW's images at the moment they were taken."""
    new = moved_back(case.new, age)
    kept = {swim.name for swim in case.days}
    days = tuple(swim for swim in swims(new) if swim.name in kept)
    rows = look(trial_rows(case.robot, new, days, NAMES), case.channels)
    return replace(case, fit=regression(case.old, rows), rows=rows, new=new, days=days)


def _next(
    case: _Case, swapped: Swapped, taken: Sequence[Key], refused: list[str]
) -> tuple[Named, Key] | None:
    """The next change with its family, or nothing where no contender is an effect of the vocabulary."""
    judged = judge_all(case.fit, taken)
    rarest = max(swapped.rarity.values())
    strong = [j for j in judged.values() if swapped.rarity.get(j.name, 0.0) >= CONTENDS * rarest]
    contenders = sorted((j for j in strong if j.gain > 0.0), key=lambda j: -j.gain)
    names = [j for j in contenders if not j.name.startswith(PARAMETER)]
    if not names or apart(contenders[0].by_trial, names[0].by_trial):
        return None
    found: list[tuple[Judged, Refitted]] = []
    kin = [j for j in names[1:] if family_of(j.name) == family_of(names[0].name) != ""]
    asked = [names[0], *kin[:KIN], *names[1:REFITTED]]
    for j in {j.name: j for j in asked}.values():
        values = refit(case.fit, case.rows, case.robot, case.new, case.days, j)
        if values.degenerate:
            refused.append(values.degenerate)
        else:
            found.append((j, values))
    if not found:
        return None
    found.sort(key=lambda one: -one[1].by_trial.mean())
    top = found[0][1].by_trial
    alike = [(j, v) for j, v in found if not apart(top, v.by_trial)]
    kept = {j.name for j, _ in alike}
    alike = [(j, v) for j, v in alike if SPECIAL_CASE.get(j.name) not in kept]
    best, first = alike[0]
    weights = [tie(first.by_trial, v.by_trial) for _, v in alike]
    members = []
    for (j, values), weight in zip(alike, weights, strict=True):
        left = swap_test(case.fit, case.strata, FEW_SWAPS, taken=(*taken, j.key)).p_value
        members.append(Member(j.name, weight / sum(weights), values.by_trial.mean(), left, values))
    return Named(tuple(members), family_of(best.name), *mean_gain(first.by_trial)), best.key
