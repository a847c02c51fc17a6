# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The model that a diagnosis starts from: the given robot, free in all that the recordings determine of it.

The effects and sensor errors of the given robot belong to it like its drags: one that is a little off would be taken for
missing physics.
"""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import SENSOR_FIELDS, Hypothesis, nominal_hypothesis
from fish_sysid.estimation.thresholds import UNIDENTIFIABLE


def known_effects(robot: Robot) -> tuple[str, ...]:
    """Effects of a robot itself and its sensor errors that the filter models, less the filter's latent wrench."""
    effects = (name for name in robot.effects if name != "disturbance")
    return (*effects, *(name for name in robot.sensors if name in SENSOR_FIELDS))


def known_parameters(robot: Robot) -> tuple[str, ...]:
    """Parameters of a robot's own effects, as a hypothesis names them."""
    values = {**robot.effects, **robot.sensors}
    return tuple(f"{name}.{key}" for name in known_effects(robot) for key in values[name])


def start_hypothesis(robot: Robot, experiment: Experiment, noise: Noise) -> Hypothesis:
    """The robot with its nominal parameters free, and of its own effects those that these recordings determine.

    The others stay as given: the prior would draw them to where the effect is none.
    """
    nominal, own = nominal_hypothesis(robot), known_parameters(robot)
    if not own:
        return nominal
    everything = Hypothesis(nominal.robot, nominal.free + own)
    parametrization = everything.parametrization
    information = evaluate(everything, parametrization.origin(), experiment, noise).information
    effects = range(len(nominal.free), len(everything.free))
    kept = identifiable(information, parametrization.prior, effects)
    return Hypothesis(nominal.robot, tuple(everything.free[i] for i in kept))


def identifiable(information: Array, prior: Array, own: range) -> list[int]:
    """Parameters (K,) less those of `own` that the information, which includes the prior, leaves about as unsure as the prior.

    One after the other, the least sure first: recordings may determine a payload's mass times its place alone, and with the
    place fixed they determine the mass.
    """
    kept = list(range(len(prior)))
    while True:
        covariance = np.linalg.inv(information[np.ix_(kept, kept)])
        ratio = dict(
            zip(kept, (np.sqrt(np.diagonal(covariance)) / prior[kept]).tolist(), strict=True)
        )
        unsure = [i for i in kept if i in own and ratio[i] > UNIDENTIFIABLE]
        if not unsure:
            return kept
        kept.remove(max(unsure, key=lambda i: ratio[i]))
