# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The next name: contenders by gain and by rarity, refitted, and what exchanged trials say of the remainder of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.candidates import PARAMETER
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.channels import Swim
from fish_sysid.diagnosis.change.naming import SPECIAL_CASE, Judged, apart, tie
from fish_sysid.diagnosis.change.rows import TrialRows
from fish_sysid.diagnosis.change.servos import OldAnswer
from fish_sysid.diagnosis.change.shared_fit import Key, Regression
from fish_sysid.diagnosis.change.strength import Refitted, refit
from fish_sysid.diagnosis.change.swap_test import REMAINDER, Swapped, swap_test
from fish_sysid.diagnosis.vocabulary import family_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
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
    answer: OldAnswer


CONTENDS = 0.5  # of the largest - log p of a name that a contender has
REFITTED = 4  # contenders of any family by their gain, as many by it undivided, and as many by their rarity
MOST = 2 / 3  # of the weight of all contenders, that a family has which is named without numbers
KIN = 6  # further members of the best one's family
FEW_SWAPS = 150  # of a contender's remainder


@dataclass(frozen=True)
class Contender:
    """A name that may be the next one."""

    judged: Judged
    refitted: Refitted
    remainder: float  # p-value once it is taken out
    rarity: float  # - log p of its own gain among exchanged trials

    @property
    def nats(self) -> Array:
        """On each of NEW's trials (M,), left out, not divided by the dispersion."""
        return self.refitted.by_trial * self.judged.dispersion

    @property
    def survives(self) -> bool:
        """Whether what it leaves looks like exchanged trials."""
        return self.remainder > REMAINDER


Rival = TypeVar("Rival", Judged, Contender)


def next_change(
    case: Case,
    swapped: Swapped,
    judged: Mapping[str, Judged],
    taken: Sequence[Key],
    refused: list[str],
) -> tuple[Named, Key] | None:
    """The next change with its family, or nothing where no contender is an effect of the vocabulary.

    A name that leaves nothing is an explanation; one that leaves something is part of one. So the first go before the second
    unless they predict trials left out clearly worse.
    """
    found: list[Contender] = []
    impossible: list[Contender] = []
    for one in _asked(swapped, judged):
        values = refit(case.fit, case.rows, case.robot, case.new, case.days, one)
        rarity = swapped.rarity.get(one.name, 0.0)
        if values.refused:
            refused.append(values.refused)
            as_found = replace(values, by_trial=one.by_trial)
            impossible.append(Contender(one, as_found, 0.0, rarity))
        elif values.by_trial.mean() > 0.0:
            left = swap_test(
                case.fit, case.strata, FEW_SWAPS, taken=(*taken, one.key), days=case.day_of
            )
            found.append(Contender(one, values, left.p_value, rarity))
    if not found:
        return family_alone(swapped, judged)
    alike, weights = weighed(found, impossible)
    members = tuple(
        Member(one.judged.name, weight, one.remainder, one.refitted)
        for one, weight in zip(alike, weights, strict=True)
    )
    return Named.of(members), alike[0].judged.key


def family_alone(swapped: Swapped, judged: Mapping[str, Judged]) -> tuple[Named, Key] | None:
    """A family without numbers, where its members explain most and the model gives none of them a strength that can be.

    On a plant of another structure an effect may work the other way round than in the model. That what changed has no name is
    then as likely as all names together.
    """
    names = _contenders(swapped, judged)
    if not names:
        return None
    alike = _unbeaten(names)
    best = max(alike, key=lambda one: one.nats.mean())
    weight = {
        one.name: tie(best.nats, one.nats) * math.exp(swapped.rarity[one.name]) for one in alike
    }
    family = family_of(best.name)
    kin = [one for one in alike if family_of(one.name) == family != ""]
    share = sum(weight[one.name] for one in kin) / sum(weight.values())
    if len(kin) < 2 or share < MOST:
        return None
    kin.sort(key=lambda one: -weight[one.name])
    total = 2.0 * sum(weight.values())
    members = tuple(
        Member(one.name, weight[one.name] / total, math.nan, Refitted({}, "", one.by_trial))
        for one in kin
    )
    return Named.of(members), kin[0].key


def weighed(
    found: Sequence[Contender], impossible: Sequence[Contender] = ()
) -> tuple[list[Contender], list[float]]:
    """Those that the data cannot tell from the best, the likeliest first, and their probabilities.

    Of those that leave nothing; kin of the likeliest that leave something stay, with a weight that falls with what they leave.
    A name that explains as much with values that it cannot have says that what changed may have no name: its weight is missing
    in the sum.
    """
    tied = _unbeaten(found)
    alike = [one for one in tied if one.survives] or tied
    kept = {one.judged.name for one in alike}
    alike = [one for one in alike if SPECIAL_CASE.get(one.judged.name) not in kept]
    best = max(alike, key=lambda one: one.nats.mean()).nats
    doubt = [
        one
        for one in impossible
        if SPECIAL_CASE.get(one.judged.name) not in kept and not apart(best, one.nats)
    ]
    weight = {
        one.judged.name: tie(best, one.nats) * math.exp(one.rarity) for one in (*tied, *doubt)
    }
    first = max(alike, key=lambda one: weight[one.judged.name])
    for one in tied:
        if one.judged.name not in kept and _kin(one.judged.name, first.judged.name):
            weight[one.judged.name] *= one.remainder / REMAINDER
            alike.append(one)
    total = sum(weight[one.judged.name] for one in (*alike, *doubt))
    alike.sort(key=lambda one: -weight[one.judged.name])
    return alike, [weight[one.judged.name] / total for one in alike]


def _unbeaten(rivals: Sequence[Rival]) -> list[Rival]:
    """Those that no other one predicts clearly better than."""
    return [one for one in rivals if not any(apart(other.nats, one.nats) for other in rivals)]


def _kin(name: str, other: str) -> bool:
    return family_of(name) == family_of(other) != "" and SPECIAL_CASE.get(name) != other


def _contenders(swapped: Swapped, judged: Mapping[str, Judged]) -> list[Judged]:
    """Names whose gain is as rare as any, the best first; none where a parameter of the fish itself explains clearly more."""
    rarest = max(swapped.rarity.values())
    strong = [
        one
        for one in judged.values()
        if swapped.rarity.get(one.name, 0.0) >= CONTENDS * rarest and one.gain > 0.0
    ]
    contenders = sorted(strong, key=lambda one: -one.gain)
    names = [one for one in contenders if not one.name.startswith(PARAMETER)]
    own = [one for one in contenders if one.name.startswith(PARAMETER)]
    beaten = [name for name in names if any(apart(one.nats, name.nats) for one in own)]
    return [] if len(beaten) == len(names) else names


def _asked(swapped: Swapped, judged: Mapping[str, Judged]) -> list[Judged]:
    """The candidates that are refitted: the best with and without its dispersion, the best one's kin, and the rarest."""
    names = _contenders(swapped, judged)
    if not names:
        return []
    kin = [one for one in names[1:] if family_of(one.name) == family_of(names[0].name) != ""]
    rare = sorted(names, key=lambda one: -swapped.rarity[one.name])[:REFITTED]
    undivided = sorted(names, key=lambda one: -one.nats.mean())[:REFITTED]
    asked = [names[0], *kin[:KIN], *names[1:REFITTED], *undivided, *rare]
    return list({one.name: one for one in asked}.values())
