# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The change of the rudder that the gyro's answer shows, named before any other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.contest import apart, mean_gain, tie
from fish_sysid.diagnosis.change.servos import SERVOS
from fish_sysid.diagnosis.change.step_response import Answered, step_response
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.families import family_of


@dataclass(frozen=True)
class RudderChange:
    """What the test says, with its p-value by exchanged trials."""

    p_value: float
    named: Named


def rudder_change(
    old: Experiment, new: Experiment, strata: Sequence[int], level: float
) -> RudderChange | None:
    """The servo that NEW's gyro asks for, and those that do about as well; None where the test sees nothing."""
    answer = step_response(old, new, strata)
    if answer is None or answer.p_value > level:
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


def _values(answered: Answered) -> dict[str, float]:
    return {SERVOS[answered.name].parameter: answered.estimate.value}
