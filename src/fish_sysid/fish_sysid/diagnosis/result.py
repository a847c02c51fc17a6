"""What a diagnosis found: all that the answer and the page are written from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.forward_selection import Round
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.diagnosis.residual_regression import Description
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.trial_split import Split
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit


@dataclass(frozen=True)
class Accepted:
    """An effect that was added, the round it won, and the fits that it competes with."""

    name: str
    round: Round
    # name -> fit, its own among them: of its round, or in its place of the final model
    contest: dict[str, Fit]
    foretold: float | None = (
        None  # nats on training trials left out in turn, where it stands on these
    )


@dataclass(frozen=True)
class Diagnosis:
    """Everything the answer and the page are written from. Fits are on the training trials unless said otherwise."""

    experiment: Experiment
    split: Split
    robot: Robot  # as given
    nominal: Fit
    final: Fit
    rounds: tuple[Round, ...]  # on the search trials, the last one found nothing more
    accepted: tuple[Accepted, ...]
    unreachable: dict[str, str]
    level: Level
    force: MissingForce  # that the nominal model lacks
    parts: dict[
        str, tuple[Fit, MissingForce]
    ]  # of several effects: the final model less one, and what it then lacks
    pushes: dict[
        str, MissingForce
    ]  # of the accepted effects that push: what they do in the final model
    remaining: MissingForce  # that the final model lacks
    description: Description  # of the remaining force
    given_noise: (
        Noise  # that suits the robot as given: at the refitted noise its filter would lose the fish
    )
    held_out: dict[
        str, np.ndarray
    ]  # log density per sample and held-out trial: given, nominal, final
    outlook: Fit | None = (
        None  # where much is left and no name fits: the model that predicts best (`stand_in`)
    )

    @property
    def unseen(self) -> Experiment:
        """The held-out trials, or where there are too few the training trials."""
        return self.experiment.select(self.split.held_out or self.split.training)

    @property
    def unseen_are(self) -> str:
        """What the trials are on which predictions are shown."""
        return (
            "held-out trials"
            if self.split.held_out
            else "the training trials, too few to hold any out"
        )
