# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis is asked: trials that fit, search and are held out, candidates, level, and the stages that run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import ahead_of, at_centre_of_mass, with_marker
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.vocabulary import NoCandidateError, candidates, known, not_judged
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import EffectTable, effect_class
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


Progress = Callable[[str], None]
Found = TypeVar("Found")

# name and meaning of every stage that an ablation study may switch off
STAGES = (
    ("can the model follow", "no search by likelihood where the model cannot follow the fish"),
    ("annealed screening", "candidates annealed from the nominal values where the base is far off"),
    ("nominal start", "candidates screened from the nominal values as well as from the base"),
    ("base restart", "the base refitted from the best candidate's optimum, and screened again"),
    ("check on unseen trials", "a candidate must predict trials that the search has not used"),
    ("backward elimination", "every effect tested again with those that were added after it"),
    ("model order", "more tail links tried where much is left"),
    ("surrogate model", "a model fitted by its predictions where no name fits"),
    ("surrogate's own choice", "effects in it that its predictions call for"),
)
STAGE_NAMES = frozenset(name for name, _ in STAGES)


@dataclass(frozen=True)
class Task:
    """What is asked, the same in every stage."""

    experiment: Experiment
    robot: Robot  # as given, with the table of effects
    split: Split
    trials: Trials
    names: tuple[str, ...]  # that compete
    not_judged: dict[str, str]  # name -> why these recordings say nothing about it
    level: Level
    progress: Progress
    without: frozenset[str]  # stages that are switched off
    ahead: float = 0.0  # m, of the camera's point; taken out of experiment and robot
    acted: set[str] = field(default_factory=set, compare=False)  # stages that changed the search

    def runs(self, stage: str) -> bool:
        """Whether a stage of STAGES is on."""
        if stage not in STAGE_NAMES:
            raise ValueError(f"stage {stage!r}: expected one of {', '.join(sorted(STAGE_NAMES))}")
        return stage not in self.without

    def kept(self, stage: str, before: Found, after: Found) -> Found:
        """What a stage makes of what was there; where that is another object, the stage has changed the search."""
        if after is not before:
            self.acted.add(stage)
        return after

    def needed(self, base: Fit) -> dict[str, float]:
        """Nats that each name which the base lacks must gain over it on the searched trials."""
        names = [name for name in self.names if name not in base.hypothesis.names]
        counts = {name: self.parameter_count(name) for name in names}
        return {
            n: self.level.needed(base.samples, count, len(names)) for n, count in counts.items()
        }

    def parameter_count(self, name: str) -> int:
        """Parameters of an effect."""
        return len(effect_class(name, self.robot.table).parameters)


def make_task(
    experiment: Experiment,
    robot: Robot,
    level: Level | None = None,
    progress: Progress = lambda _: None,
    names: Sequence[str] | None = None,
    effects: EffectTable = EFFECTS,
    without: Collection[str] = frozenset(),
) -> Task:
    """Raises ValueError for an unknown name or stage, NoCandidateError if none of the names can be judged."""
    for stage in without:
        if stage not in STAGE_NAMES:
            raise ValueError(f"stage {stage!r}: expected one of {', '.join(sorted(STAGE_NAMES))}")
    ahead = ahead_of(robot)
    experiment = at_centre_of_mass(experiment, ahead)
    robot = with_marker(replace(robot, table={**robot.table, **effects}), -ahead)
    split = split_trials(experiment)
    names = known(names or candidates(effects), effects)
    trials = trials_of(experiment, split)
    reasons = {n: why for n, why in not_judged(trials.training, robot).items() if n in names}
    left = tuple(name for name in names if name not in reasons)
    if not left:
        texts = "; ".join(f"{name}: {why}" for name, why in reasons.items())
        raise NoCandidateError(f"no candidate is left that could be judged ({texts})")
    return Task(
        experiment,
        robot,
        split,
        trials,
        left,
        reasons,
        level or Level(),
        progress,
        frozenset(without),
        ahead,
    )
