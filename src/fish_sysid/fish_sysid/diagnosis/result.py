# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis finds: rounds of the search, its state between the stages, and the whole of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.prediction_rivals import Named
from fish_sysid.diagnosis.significance import evidence
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit

if TYPE_CHECKING:
    from fish_sysid.diagnosis.latent_force import MissingForce
    from fish_sysid.diagnosis.residual_regression import Law
    from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
    from fish_sysid.diagnosis.task import Task


@dataclass(frozen=True)
class Screened:
    """A candidate after screening."""

    name: str
    gain: float  # nats over the base, both at the same noise
    theta: Array


@dataclass(frozen=True)
class Round:
    """One round of the search: what competed to be added to `base`."""

    base: Fit
    ranking: tuple[Screened, ...]
    refitted: dict[str, Fit]  # shortlist, each with its own noise

    @property
    def best(self) -> str | None:
        """Name of the best refitted candidate by evidence."""
        return max(self.refitted, key=lambda name: evidence(self.refitted[name]), default=None)

    def gain(self, name: str) -> float:
        """Nats over the base, both with their own noise."""
        return self.refitted[name].log_posterior - self.base.log_posterior


@dataclass(frozen=True)
class Accepted:
    """An effect that was added, the round it won, and the fits that it competes with."""

    name: str
    round: Round
    contest: dict[str, Fit]  # name -> fit, its own among them: of its round, or of the final model


@dataclass(frozen=True)
class State:
    """Where the method stands. Fits are on the training trials but for those of the rounds, on the searched ones."""

    rounds: tuple[Round, ...]
    accepted: tuple[Accepted, ...]
    nominal: Fit  # without effects
    final: Fit  # with those accepted
    law: Law  # of the force that the final fit leaves


@dataclass(frozen=True)
class Diagnosis:
    """Everything the answer and the page are written from."""

    task: Task
    state: State
    force: MissingForce  # that the nominal model lacks
    parts: dict[str, tuple[Fit, MissingForce]]  # of several effects: final model without it, lack
    pushes: dict[str, MissingForce]  # of effects that push: what they do in the final model
    remaining: MissingForce  # that the final model lacks
    given_noise: Noise  # for the robot as given, whose filter would diverge at the refitted noise
    held_out: dict[str, np.ndarray]  # log density per sample and trial: given, nominal, final
    surrogate: Fit | None = None  # where no name fits: the model that predicts best
    predicted: tuple[Named, ...] = ()  # effects of the surrogate, by trials left out
    symmetry: tuple[SymmetryFinding, ...] = ()  # every test's answer, without a model of the fish
    settled: Fit | None = None  # the search's model, refitted with what the symmetry tests find
    misses: float | None = None  # times the camera's noise, where the model cannot follow the fish
    still_misses: float | None = None  # the same with the names that predictions ask for

    @property
    def nominal(self) -> Fit:
        return self.state.nominal

    @property
    def final(self) -> Fit:
        return self.state.final

    @property
    def accepted(self) -> tuple[Accepted, ...]:
        return self.state.accepted

    @property
    def unseen(self) -> Experiment:
        """The held-out trials, or where there are too few the training trials."""
        split = self.task.split
        return self.task.experiment.select(split.held_out or split.training)

    @property
    def unseen_are(self) -> str:
        """What the trials are on which predictions are shown."""
        few = "the training trials, too few to hold any out"
        return "held-out trials" if self.task.split.held_out else few
