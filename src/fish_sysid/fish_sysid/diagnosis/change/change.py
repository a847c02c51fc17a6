# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a comparison finds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.naming import mean_gain
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.vocabulary import family_of


@dataclass(frozen=True)
class Member:
    """One name that explains a change as well as the others of its family."""

    name: str
    probability: float
    remainder_p_value: float  # of the swap test once it is taken out
    refitted: Refitted


@dataclass(frozen=True)
class Named:
    """One change: the best name first, then those that these recordings cannot tell from it."""

    members: tuple[Member, ...]
    family: str  # "" where it stands alone
    gain: float  # nats per left-out trial of NEW, mean
    gain_std: float  # standard error of that mean

    @classmethod
    def of(cls, members: tuple[Member, ...]) -> Named:
        """The change that these members explain, with the family and the gain of the best."""
        best = members[0]
        return cls(members, family_of(best.name), *mean_gain(best.refitted.by_trial))

    @property
    def name(self) -> str:
        return self.members[0].name


@dataclass(frozen=True)
class Change:
    """NEW against OLD."""

    verdict: str  # unchanged, changed, not_comparable
    reason: str = ""  # of not_comparable
    p_value: float = float("nan")
    look: str = ""  # which of the looks saw it
    named: tuple[Named, ...] = ()
    remainder_p_value: float = float("nan")
    suspects: tuple[str, ...] = ()  # of a change without a name: what gains most
    refused: tuple[str, ...] = ()  # degenerate answers
    left_out: tuple[str, ...] = ()
    robot: Robot | None = None  # OLD's best model
    old: Experiment | None = None
    new: Experiment | None = None
    camera_delay: float = 0.0  # s, of OLD's images
    symmetry: tuple[SymmetryFinding, ...] = ()  # of OLD
    rarities: Mapping[str, float] = field(default_factory=dict)  # - log p of each name by itself
