# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a pair: OLD without and NEW with what is concealed, of the second plant or of recordings that a user has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fish_bag.dataset import find_trials, read_dataset
from fish_bag.trial import Trial
from fish_study.build import make_recordings
from fish_study.scenario import Scenario, ScenarioError
from fish_study.trial_file import write_trial_file
from fish_study.trial_injection import InjectionError, with_effects

OLD, NEW = "old", "new"  # folders of a pair
NEW_SHARE = 1 / 3  # of a user's recordings
FEWEST = 10  # recordings of a user: seven of OLD and three of NEW are the least that are compared


def make_pair(scenario: Scenario, folder: Path) -> dict[str, float]:
    """Write the folders `old` and `new`; the trials that ended at a wall as `make_recordings` says.

    Raises ScenarioError where a pair cannot be made.
    """
    folder.mkdir(parents=True)
    if scenario.recordings:
        _injected(scenario, folder)
        return {}
    ended: dict[str, float] = {}
    still = replace(scenario, effects={}, count=scenario.old, seed=scenario.seed + 1)
    for name, one in ((OLD, still), (NEW, scenario)):
        at_wall = make_recordings(one, folder / name)
        ended |= {f"{name}/{trial}": seconds for trial, seconds in at_wall.items()}
    return ended


def _injected(scenario: Scenario, folder: Path) -> None:
    """Some of the user's recordings as they are, others with the concealed effects."""
    old, new = split(list(read_dataset(Path(scenario.recordings))), scenario.seed)
    for name, trials, effects in ((OLD, old, {}), (NEW, new, scenario.effects)):
        for trial in trials:
            try:
                write_trial_file(
                    folder / name / folder_name(trial.name), with_effects(trial, effects)
                )
            except (InjectionError, ValueError) as error:
                raise ScenarioError(str(error)) from error


def folder_name(trial: str) -> str:
    """Name of a trial's folder; no two trials share it, though their names have dots or lie in folders."""
    return trial.replace("/", "_").removesuffix(".mcap")


def check_count(folder: Path) -> None:
    """Raises ScenarioError where a folder holds fewer recordings than are split."""
    if (found := len(find_trials(folder))) < FEWEST:
        raise ScenarioError(
            f"--recordings {folder}: {found} recordings; expected at least {FEWEST}"
        )


def split(trials: Sequence[Trial], seed: int) -> tuple[list[Trial], list[Trial]]:
    """(OLD, NEW): runs chosen at random, NEW_SHARE of them NEW. Raises ScenarioError for too few."""
    usable = [trial for trial in trials if trial.commands is not None and trial.camera is not None]
    if len(usable) < FEWEST:
        raise ScenarioError(
            f"got {len(usable)} recordings with commands and camera; expected at least {FEWEST}, which are split into OLD and NEW"
        )
    order = np.random.default_rng(seed).permutation(len(usable))
    count = max(3, round(NEW_SHARE * len(usable)))
    new, old = sorted(order[:count].tolist()), sorted(order[count:].tolist())
    return [usable[i] for i in old], [usable[i] for i in new]
