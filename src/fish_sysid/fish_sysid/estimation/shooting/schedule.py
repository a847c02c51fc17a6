# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From a robot that nobody has measured to the optimum that predicts: can it follow, starts, polish, trust in the sensors.

A model that is right leaves the camera's noise in short windows with free start states. One that lacks something cannot follow
two seconds of swimming from any start state: its innovations are then no innovations, and its likelihood chooses for the wrong
reasons.

The stroke's phase makes the cost multimodal in how stiff and how heavy the tail is. A tail that is too stiff leads from a smooth
side, so that windows are fitted from several stiffnesses; the cost of predictions over seconds tells their optima apart.

A model that lacks something leaves its start state between what the sensors say now and what they said a second ago. Which of
them is right more often is no property of the sensors. It is found with the fit: each scale is halved or doubled as long as
stroke means 0.5 to 5 s ahead get better. Only training trials take part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import Hypothesis, nominal_hypothesis
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.residuals import SENSORS, Scale, cut, regular_starts
from fish_sysid.estimation.shooting.rollout import ShotParametrization
from fish_sysid.estimation.shooting.start_states import PAST, START_TRUST, without_sensor_errors
from fish_sysid.prediction.prediction import WARM_UP, start_points

Array = NDArray[np.float64]
Report = Callable[[str], None]

# factors of the tail's stiffness, of masses and drags in sway
LADDER = ((1.0, 1.0), (5.0, 2.0), (25.0, 3.0))
LENGTH = 4.0  # s, of a window
FIRST = PAST  # s, of the first window; before it the tail runs in
COARSE, FINE = 2.0, 1.0  # windows and start points: one of so many
ITERATIONS = 12  # of shooting
ROUNDS = 4  # of states and parameters
FOLLOWED, APART = 2.0, 8.0  # s, of windows in which the model has to follow, and between them
FOLLOWING = 8  # iterations of shooting there
FAINT = 0.05  # typical strengths, at which effects start
TOO_FAR = 2.0  # times the camera's noise
FACTORS = (0.5, 2.0)
SWEEPS = 3  # over all scales
WORTH = 0.003  # of the cost; a change that gains less is none
MOVING = ("position", "heading", "orientation", "fading")
SLOWEST = 4.0  # s; beyond it an older sample counts as much as a new one


@dataclass(frozen=True)
class Found:
    """An optimum."""

    hypothesis: Hypothesis
    z: Array  # (K + 4,) theta and the sensors' parameters
    cost: float  # of predictions
    trust: Scale = START_TRUST  # of start states in the sensors


def ladder_start(hypothesis: Hypothesis, stiffness: float, heavy: float) -> Array:
    """Theta (K,) with the tail's stiffness and all masses and drags in sway times these factors."""
    values = hypothesis.parametrization.start.copy()
    for i, name in enumerate(hypothesis.free):
        if name == "tail_stiffness":
            values[i] *= stiffness
        elif "." not in name and name.endswith(("added_mass_sway", "drag_sway")):
            values[i] *= heavy
    return hypothesis.parametrization.encode(values)


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
    stiffer = ", ".join(f"{stiffness:g}" for stiffness, _ in LADDER)
    report(f"shooting, {hypothesis.robot.links} links, tail {stiffer} times as stiff")

    def climbed(rung: tuple[float, float]) -> Found:
        _, z = shoot(experiment, hypothesis, ladder_start(hypothesis, *rung))
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


def misfit(
    experiment: Experiment,
    robot: Robot,
    noise: Noise,
    free: Sequence[str],
    length: float = FOLLOWED,
    effects: Sequence[str] = (),
) -> float:
    """The larger of the camera's residuals in position and heading over their noise (medians), of the better start.

    effects: that the model may have as well, all at once, whatever the robot has of them. What the robot states of the camera is
    taken out of the images first. 0 where no window can be cut: nothing speaks against the model.
    """
    experiment, sizes = without_sensor_errors(experiment, robot), []
    windows = cut(experiment, regular_starts(experiment, length, APART, FIRST), length)
    if not len(windows):
        return 0.0
    hypothesis = nominal_hypothesis(robot, tuple(free))
    for name in effects:
        hypothesis = hypothesis.without(name).with_effect(name, FAINT)
    for stiffness, heavy in LADDER[:2]:
        theta = ladder_start(hypothesis, stiffness, heavy)
        shooting = Shooting(experiment, ShotParametrization(hypothesis, theta), windows)
        guess = shooting.settle(shooting.first_guess(theta))
        _, guess = shooting.fit(guess, FOLLOWING)
        e, F = shooting.errors(guess).e, len(windows.poses.t)
        position = _size(e[: 2 * F]) * shooting.scale.position / noise.camera_position
        heading = _size(e[2 * F : 3 * F]) * shooting.scale.heading / noise.camera_heading
        sizes.append(max(position, heading))
    return float(min(sizes))


def _size(e: np.ndarray) -> float:
    """Standard deviation of a normal distribution with this median of sizes."""
    return float(np.median(np.abs(e)) / 0.6745)


def trusted(experiment: Experiment, found: Found, every: float = FINE) -> Found:
    """The fit with the trust under which it predicts these trials best."""

    def cost(trust: Scale) -> float:
        return multistep(experiment, replace(found, trust=trust), every).cost(found.z)

    best, trust = cost(found.trust), found.trust
    for _ in range(SWEEPS):
        before = best
        for name in MOVING:
            for factor in FACTORS:
                tried = replace(trust, **{name: factor * getattr(trust, name)})
                if tried.fading <= SLOWEST and (other := cost(tried)) < (1.0 - WORTH) * best:
                    best, trust = other, tried
                    break
        if best == before:
            break
    return replace(found, trust=trust)
