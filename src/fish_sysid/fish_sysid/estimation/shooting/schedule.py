# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From a robot that nobody has measured to the optimum that predicts: starts over the tail's natural frequency, then polish.

The stroke's phase makes the cost multimodal in how stiff and how heavy the tail is. A tail that is too stiff leads from a smooth
side, so that windows are fitted from several stiffnesses; the cost of predictions over seconds tells their optima apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import Hypothesis, Parametrization
from fish_sysid.estimation.shooting.coordinates import ShotParametrization
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.residuals import SENSORS, Scale
from fish_sysid.estimation.shooting.start_states import PAST, START_TRUST
from fish_sysid.estimation.shooting.windows import cut, regular_starts
from fish_sysid.prediction.prediction import WARM_UP, start_points

Array = NDArray[np.float64]
Report = Callable[[str], None]

LADDER = (
    (1.0, 1.0),
    (5.0, 2.0),
    (25.0, 3.0),
)  # factors of the tail's stiffness, of masses and drags in sway
LENGTH = 4.0  # s, of a window
FIRST = PAST  # s, of the first window; before it the tail runs in
COARSE, FINE = 2.0, 1.0  # windows and start points: one of so many
ITERATIONS = 12  # of shooting
ROUNDS = 4  # of states and parameters


@dataclass(frozen=True)
class Found:
    """An optimum."""

    hypothesis: Hypothesis
    z: Array  # (K + 4,) theta and the sensors' parameters
    cost: float  # of predictions
    trust: Scale = START_TRUST  # of start states in the sensors


def ladder_start(coordinates: Parametrization, stiffness: float, heavy: float) -> Array:
    """Theta with the tail's stiffness and all masses and drags in sway times these factors."""
    values = coordinates.start.copy()
    for i, name in enumerate(coordinates.hypothesis.free):
        if name == "tail_stiffness":
            values[i] *= stiffness
        elif "." not in name and name.endswith(("added_mass_sway", "drag_sway")):
            values[i] *= heavy
    return coordinates.encode(values)


def shoot(
    experiment: Experiment, hypothesis: Hypothesis, theta: Array, every: float = COARSE
) -> tuple[float, Array]:
    """(cost, z) by multiple shooting from theta (K,), one window of LENGTH in `every` times LENGTH."""
    coordinates = ShotParametrization(hypothesis, theta)
    starts = regular_starts(experiment, LENGTH, every * LENGTH, FIRST)
    shooting = Shooting(experiment, coordinates, cut(experiment, starts, LENGTH))
    guess = shooting.settle(shooting.first_guess(theta))
    cost, guess = shooting.fit(guess, ITERATIONS)
    return cost, guess.z


def can_be_predicted(experiment: Experiment) -> bool:
    """Whether the trials are long enough for windows and for predictions."""
    starts = regular_starts(experiment, LENGTH, COARSE * LENGTH, FIRST)
    return bool(
        len(cut(experiment, starts, LENGTH)) and len(start_points(experiment, FINE, WARM_UP))
    )


def multistep(experiment: Experiment, found: Found, every: float = FINE) -> Multistep:
    """Prediction errors from start points every `every` [s] with a stepper that suits the fit."""
    coordinates = ShotParametrization(found.hypothesis, found.z[: -len(SENSORS)])
    starts = start_points(experiment, every, WARM_UP)
    return Multistep(experiment, coordinates, starts, trust=found.trust)


def best_start(
    experiment: Experiment, hypothesis: Hypothesis, report: Report = lambda _: None
) -> Found:
    """The best of the optima that the ladder of stiffnesses leads to, by coarse predictions."""
    origin = Parametrization(hypothesis)
    stiffer = ", ".join(f"{stiffness:g}" for stiffness, _ in LADDER)
    report(f"shooting, {hypothesis.robot.links} links, tail {stiffer} times as stiff")

    def climbed(rung: tuple[float, float]) -> Found:
        _, z = shoot(experiment, hypothesis, ladder_start(origin, *rung))
        start = Found(hypothesis, z, np.inf)
        cost, z = multistep(experiment, start, 4.0 * FINE).improve(z, 2, 2)
        return Found(hypothesis, z, cost)

    return min(on_all_cores(climbed, LADDER), key=lambda found: found.cost)


def polished(
    experiment: Experiment, found: Found, every: float = FINE, rounds: int = ROUNDS
) -> Found:
    """Predictions made better from where the fit stands."""
    cost, z = multistep(experiment, found, every).improve(found.z, rounds)
    return replace(found, z=z, cost=cost)
