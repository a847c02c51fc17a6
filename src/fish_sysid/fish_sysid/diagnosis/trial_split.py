"""Which trials fit, which are held out, which are enough to search on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.experiment import Experiment

Array = NDArray[np.float64]

SEARCH_TRIALS = (
    4  # the search's cost is proportional to them; the final fits use all training trials
)


@dataclass(frozen=True)
class Split:
    """Indices of trials."""

    training: tuple[int, ...]
    held_out: tuple[int, ...]
    search: tuple[int, ...]  # part of training: names are ranked and fitted on these
    check: tuple[int, ...]  # the rest of training: what the search fitted must foretell these


@dataclass(frozen=True)
class Trials:
    """The trials of a search."""

    training: Experiment
    searched: Experiment  # part of them
    check: tuple[int, ...]  # positions among training of those that are not searched


def trials_of(experiment: Experiment, split: Split) -> Trials:
    """What a search sees of an experiment."""
    check = tuple(split.training.index(i) for i in split.check)
    return Trials(experiment.select(split.training), experiment.select(split.search), check)


def split_trials(experiment: Experiment) -> Split:
    """Every third trial is held out; the search uses the most strongly and most differently excited training trials.

    The held-out ones have no say in which these are: excitation is measured against the training trials' own.
    """
    count = len(experiment.names)
    held = tuple(i for i in range(count) if i % 3 == 2)
    training = tuple(i for i in range(count) if i % 3 != 2)
    strength = dict(zip(training, excitation(experiment.select(training)).tolist(), strict=True))
    chosen = sorted(training, key=lambda i: -strength[i])[:SEARCH_TRIALS]
    return Split(
        training, held, tuple(sorted(chosen)), tuple(i for i in training if i not in chosen)
    )


def excitation(experiment: Experiment) -> Array:
    """(M,) how strongly and differently the commands of each trial move the fish, 1.2 at most.

    rotor (0.2 + rudder), each over its largest: the standard deviation of the speed, and that of the rudder's angle and a
    fifth of its mean size. Of each trial's own samples: zeros that pad it to the longest are no commands.
    """
    own = np.arange(len(experiment.commands))[:, None] < experiment.steps
    speed, angle = np.moveaxis(experiment.commands, -1, 0)
    rudder = angle.std(axis=0, where=own) + 0.2 * np.abs(angle).mean(axis=0, where=own)
    rotor = speed.std(axis=0, where=own)
    return np.asarray(rotor / (rotor.max() + 1e-12) * (0.2 + rudder / (rudder.max() + 1e-12)))
