# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What explains the difference: names one at a time, until what is left looks like exchanged trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fish_sysid.dataset.camera import fine_delay, moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.candidates import (
    COLUMNS,
    PARAMETER,
    POOL_AND_SENSORS,
    SIMULATED,
    typical,
)
from fish_sysid.diagnosis.change.change import Change, Named
from fish_sysid.diagnosis.change.channels import same_trials
from fish_sysid.diagnosis.change.contenders import Case, next_change
from fish_sysid.diagnosis.change.naming import Judged, judge_all, strength_of
from fish_sysid.diagnosis.change.rows import look, trial_rows
from fish_sysid.diagnosis.change.servos import SERVOS, with_servo
from fish_sysid.diagnosis.change.shared_fit import Key, by_old_trials, regression
from fish_sysid.diagnosis.change.strength import refitted
from fish_sysid.diagnosis.change.swap_test import REMAINDER, Swapped, at_once, swap_test
from fish_sysid.diagnosis.symmetry.finding import Estimate

MOST_CHANGES = 3
# of the gain of a simulated name that a later one must have: on a plant of another structure a simulated effect has the right
# shape to about a half, and a quarter of its squares is left to others
SHARE = 0.3
SERVO_ROUNDS = 2  # of linearisation of a servo's number
MUCH_MORE = 3.0  # times the gain in the mean motion, with which the strokes name
LEAST = 1.0  # nats per trial, that count as such a gain
SUSPECTS = 4  # of a remainder without a name
NAMES = tuple(dict.fromkeys((*POOL_AND_SENSORS, *COLUMNS, *SIMULATED)))


def explained(change: Change, looks: Sequence[Case], seen: Sequence[Swapped]) -> Change:
    """Names one at a time, until what is left looks like exchanged trials. An age of the images is taken out exactly.

    looks: OLD and NEW in the mean motion, and with the strokes; seen: what exchanged trials say of each.
    """
    steps: list[_Step] = []
    refused: list[str] = []
    while len(steps) < MOST_CHANGES and (at_once(seen) <= REMAINDER or not steps):
        case, swapped, judged = telling(looks, seen, _taken(steps))
        answer = next_change(case, swapped, judged, _taken(steps), refused)
        if answer is None:
            break
        one, key = answer
        if one.gain < SHARE * _simulated_gain(steps):
            break
        numbers = one.members[0].refitted.parameters
        if numbers and one.name == "camera_latency":
            age, one = exact_age(change.old, case.new, one)
            looks = [with_new(case, moved_back(case.new, age)) for case in looks]
            steps.append(_Step(one, None))
        elif numbers and by_old_trials(key):
            looks, one = with_its_commands(looks, one, key, _taken(steps))
            if one.members[0].refitted.refused:
                refused.append(one.members[0].refitted.refused)
                break
            steps.append(_Step(one, None))
        else:
            steps.append(_Step(one, key))
        seen = swapped_in(looks, _taken(steps))
        if one.name in SIMULATED and not numbers:
            break  # the model does not have the shape of what changed: it cannot say what else there is
    steps, seen = needed(looks, steps, seen)
    named = list(change.named)
    for step in steps:
        named = merged(named, step.named)
    left = at_once(seen)
    rarity = min(seen, key=lambda one: one.p_value).rarity
    suspects = sorted(rarity, key=lambda n: -rarity[n])[:SUSPECTS] if left <= REMAINDER else []
    return replace(
        change,
        named=tuple(named),
        remainder_p_value=left,
        suspects=tuple(suspects),
        refused=tuple(dict.fromkeys(refused)),
    )


def swapped_in(looks: Sequence[Case], taken: Sequence[Key]) -> list[Swapped]:
    """What exchanged trials say in each look of what the names taken leave."""
    return [swap_test(c.fit, c.strata, taken=taken, days=c.day_of) for c in looks]


def telling(
    looks: Sequence[Case], seen: Sequence[Swapped], taken: Sequence[Key]
) -> tuple[Case, Swapped, dict[str, Judged]]:
    """The look that names: the mean motion, or a later one in which the best name gains MUCH_MORE on trials left out."""
    judged = [judge_all(case.fit, taken) for case in looks]
    best = 0
    for k in range(1, len(looks)):
        if _largest(judged[k]) > MUCH_MORE * _largest(judged[best]):
            best = k
    return looks[best], seen[best], judged[best]


def _largest(judged: dict[str, Judged]) -> float:
    """Gain of the best name of the vocabulary, LEAST at least."""
    gains = [one.gain for name, one in judged.items() if not name.startswith(PARAMETER)]
    return max(LEAST, *gains)


@dataclass(frozen=True)
class _Step:
    """One change that was named, with the candidate that is free in NEW from then on; None: it is taken out of NEW."""

    named: Named
    key: Key | None


def _taken(steps: Sequence[_Step]) -> list[Key]:
    return [step.key for step in steps if step.key is not None]


def _simulated_gain(steps: Sequence[_Step]) -> float:
    """The largest gain of a name whose shape is the model's."""
    return max((s.named.gain for s in steps if s.named.name in SIMULATED), default=0.0)


def needed(
    looks: Sequence[Case], steps: Sequence[_Step], seen: Sequence[Swapped]
) -> tuple[list[_Step], Sequence[Swapped]]:
    """The changes without those that the later ones make superfluous."""
    kept = list(steps)
    for step in steps[:-1]:
        if step.key is None:
            continue
        others = [one for one in kept if one is not step]
        without = swapped_in(looks, _taken(others))
        if min(at_once(without), at_once(seen)) > REMAINDER:
            kept, seen = others, without
    return kept, seen


def merged(named: Sequence[Named], one: Named) -> list[Named]:
    """The changes with one more; of one family there is one, whose members explain it together or in turn."""
    for i, other in enumerate(named):
        if other.family and other.family == one.family:
            had = {m.name for m in other.members}
            more = tuple(m for m in one.members if m.name not in had)
            return [*named[:i], replace(other, members=other.members + more), *named[i + 1 :]]
    return [*named, one]


def exact_age(old: Experiment | None, new: Experiment, one: Named) -> tuple[float, Named]:
    """How much older NEW's images are than OLD's, by camera and gyro, and the change with that number.

    Where camera and gyro do not tell both ages, the change keeps its own number.
    """
    first = one.members[0]
    (before, error), (after, own) = (0.0, 0.0) if old is None else fine_delay(old), fine_delay(new)
    if not (np.isfinite([before, error, own]).all() and after > 0.0):
        return first.refitted.parameters["delay"].value, one
    age = Estimate(after - before, float(np.hypot(error, own)), "s")
    values = replace(first.refitted, parameters={"delay": age})
    return age.value, replace(one, members=(replace(first, refitted=values), *one.members[1:]))


def with_its_commands(
    looks: Sequence[Case], one: Named, key: Key, taken: Sequence[Key]
) -> tuple[list[Case], Named]:
    """NEW with its commands as the servo of today passes them on, and the change with the number that leaves none of it."""
    first, (name, _) = one.members[0], key
    servo = SERVOS[name]
    found = first.refitted.parameters[servo.parameter]
    unit, value = typical(name, servo.parameter) - servo.neutral, found.value
    for _ in range(SERVO_ROUNDS):
        moved = [with_new(case, with_servo(case.new, name, value)) for case in looks]
        value += unit * float(strength_of(moved[0].fit, key, taken)[0])
    values = refitted(
        name, {servo.parameter: value}, {servo.parameter: found.std}, first.refitted.by_trial
    )
    return moved, replace(one, members=(replace(first, refitted=values), *one.members[1:]))


def with_new(case: Case, new: Experiment) -> Case:
    """The case with other recordings of NEW."""
    days = same_trials(case.days, new)
    rows = case.answer.added(trial_rows(case.robot, new, days, NAMES), days, new)
    rows = look(rows, case.channels)
    return replace(case, fit=regression(case.old, rows), rows=rows, new=new, days=days)
