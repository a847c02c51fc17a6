# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The change of the rudder that the gyro's answer shows: named before any other, or a second opinion on the rudder's timing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.contest import apart, mean_gain, tie
from fish_sysid.diagnosis.change.servos import SERVOS
from fish_sysid.diagnosis.change.step_response import Answered, step_response
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.families import family_of

SECOND_LEVEL = 0.1  # p-value up to which the gyro's answer helps to name what another look has seen


@dataclass(frozen=True)
class RudderChange:
    """What the test says, with its p-value by sets of trials in NEW's place."""

    p_value: float
    named: Named


def rudder_change(old: Experiment, new: Experiment, strata: Sequence[int]) -> RudderChange | None:
    """The servo that NEW's gyro asks for, and those that do about as well; None where no servo does better than none."""
    answer = step_response(old, new, strata)
    if answer is None:
        return None
    real = [s for s in answer.servos if not degenerate(s.name, _values(s))]
    if not real or real[0].gains.mean() <= 0.0:
        return None
    alike = [s for s in real if not apart(real[0].gains, s.gains)]
    weights = [tie(real[0].gains, s.gains) for s in alike]
    members = tuple(
        Member(
            s.name,
            weight / sum(weights),
            float(s.gains.mean()),
            float("nan"),
            Refitted({SERVOS[s.name].parameter: s.estimate}, "", s.gains),
        )
        for s, weight in zip(alike, weights, strict=True)
    )
    return RudderChange(
        answer.p_value, Named(members, family_of(members[0].name), *mean_gain(real[0].gains))
    )


def with_second_opinion(named: Sequence[Named], servo: RudderChange | None) -> list[Named]:
    """The changes, those of the rudder's timing by the means of their probabilities and of those by the gyro's answer.

    The answer has no say where exchanged trials do as well more often than in SECOND_LEVEL.
    """
    if servo is None or servo.p_value > SECOND_LEVEL:
        return list(named)
    return [_both(one, servo.named) if one.family == servo.named.family else one for one in named]


def _both(by_motion: Named, by_gyro: Named) -> Named:
    """One change with the members of both; where both have one, its numbers are those by the gyro."""
    half: dict[str, Member] = {}
    for member in (*by_gyro.members, *by_motion.members):
        had = half.get(member.name, member)
        share = 0.5 * member.probability + (
            half[member.name].probability if member.name in half else 0.0
        )
        half[member.name] = replace(had, probability=share)
    members = sorted(half.values(), key=lambda m: -m.probability)
    return replace(by_motion, members=tuple(members))


def _values(answered: Answered) -> dict[str, float]:
    return {SERVOS[answered.name].parameter: answered.estimate.value}
