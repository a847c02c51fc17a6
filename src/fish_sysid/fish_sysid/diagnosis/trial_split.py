# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which trials fit, which are held out, which are enough to search on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.estimation.thresholds import FIRST_STEPS, SEARCH_TRIALS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """Indices of trials."""

    training: tuple[int, ...]
    held_out: tuple[int, ...]
    search: tuple[int, ...]  # part of training: candidates are screened and fitted on these
    check: tuple[int, ...]  # the rest of training, which the fits of the search must predict


@dataclass(frozen=True)
class Trials:
    """The trials of a search."""

    training: Experiment
    searched: Experiment  # part of them
    short: Experiment  # the first seconds of the searched ones
    check: tuple[int, ...]  # positions among training of those that are not searched


def trials_of(experiment: Experiment, split: Split) -> Trials:
    """What a search sees of an experiment."""
    check = tuple(split.training.index(i) for i in split.check)
    searched = experiment.select(split.search)
    short = shorten(searched, FIRST_STEPS)
    return Trials(experiment.select(split.training), searched, short, check)


def split_trials(experiment: Experiment) -> Split:
    """Every third trial is held out; the search uses the most strongly and most differently excited training trials.

    Excitation is measured against the training trials' own, so that held-out trials have no influence.
    """
    count = len(experiment.names)
    held = tuple(i for i in range(count) if i % 3 == 2)
    training = tuple(i for i in range(count) if i % 3 != 2)
    strength = dict(zip(training, excitation(experiment.select(training)).tolist(), strict=True))
    search = tuple(sorted(sorted(training, key=lambda i: -strength[i])[:SEARCH_TRIALS]))
    return Split(training, held, search, tuple(i for i in training if i not in search))


def excitation(experiment: Experiment) -> Array:
    """(M,) how strongly and differently the commands of each trial move the fish, 1.2 at most.

    rotor (0.2 + rudder), each over its largest: the standard deviation of the speed, and that of the rudder's angle and a
    fifth of its mean size. Of each trial's own samples, without the padding.
    """
    own = np.arange(len(experiment.commands))[:, None] < experiment.steps
    speed, angle = np.moveaxis(experiment.commands, -1, 0)
    rudder = angle.std(axis=0, where=own) + 0.2 * np.abs(angle).mean(axis=0, where=own)
    rotor = speed.std(axis=0, where=own)
    return np.asarray(rotor / (rotor.max() + 1e-12) * (0.2 + rudder / (rudder.max() + 1e-12)))
