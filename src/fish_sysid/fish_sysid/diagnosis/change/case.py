# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""OLD and NEW as one look sees them."""

from __future__ import annotations

from dataclasses import dataclass

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.channels import Swim
from fish_sysid.diagnosis.change.other_commands import OldAnswer
from fish_sysid.diagnosis.change.rows import TrialRows
from fish_sysid.diagnosis.change.shared_fit import Regression


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
