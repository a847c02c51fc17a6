"""The model that a diagnosis starts from: the robot as it is given, refitted in all that the recordings tell of it.

Parameters of effects and sensor errors that the robot already has belong to it like its drags: one that is a little off would
be taken for missing physics. A rudder given askew by 0.06 rad that stood askew by 0.09 was called a hull's asymmetry.
"""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import Coordinates, Hypothesis, nominal_hypothesis

UNTOLD = 0.25  # of the prior's standard deviation: as unsure as this, a refit would follow the prior as well


def own_effects(robot: Robot) -> tuple[str, ...]:
    """Effects and sensor errors of a robot itself, less the wrench that stands for what a model lacks."""
    return tuple(name for name in (*robot.effects, *robot.sensors) if name != "disturbance")


def own_parameters(robot: Robot) -> tuple[str, ...]:
    """Parameters of a robot's own effects, as a hypothesis calls them."""
    values = {**robot.effects, **robot.sensors}
    return tuple(f"{name}.{key}" for name in own_effects(robot) for key in values[name])


def given_hypothesis(robot: Robot, experiment: Experiment, noise: Noise) -> Hypothesis:
    """The robot with its nominal parameters free, and of those of its own effects all that these recordings tell.

    The others stay as given: the prior would draw them to where the effect is none (a wall that no trial comes near).
    """
    nominal, own = nominal_hypothesis(robot), own_parameters(robot)
    if not own:
        return nominal
    everything = Hypothesis(nominal.robot, nominal.free + own)
    coordinates = Coordinates(everything)
    normal = evaluate(everything, coordinates.origin(), experiment, noise).normal
    kept = told(normal, coordinates.prior, range(len(nominal.free), len(everything.free)))
    return Hypothesis(nominal.robot, tuple(everything.free[i] for i in kept))


def told(normal: Array, prior: Array, own: range) -> list[int]:
    """Parameters (K,) less those of `own` of which a normal matrix, the prior's part in it, tells little.

    One after the other, the least sure first: of a payload the data may tell mass times place alone, and with the place held
    they tell the mass.
    """
    kept = list(range(len(prior)))
    while True:
        unsure = np.sqrt(np.diagonal(np.linalg.inv(normal[np.ix_(kept, kept)]))) / prior[kept]
        asked = {
            i: u for i, u in zip(kept, unsure.tolist(), strict=True) if i in own and u > UNTOLD
        }
        if not asked:
            return kept
        kept.remove(max(asked, key=lambda i: asked[i]))
