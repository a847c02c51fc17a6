"""The model before an effect is added, fitted to recordings that it may not explain."""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.known_effects import given_hypothesis
from fish_sysid.diagnosis.screening import crowd
from fish_sysid.estimation.annealed_fit import (
    LEADING,
    TAIL_INERTIAS,
    close,
    fit_tempered,
    lead,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.global_fit import (
    FIRST_STEPS,
    SUSPICIOUS,
    UNWHITE,
    better,
    excess,
    fit_cold,
)
from fish_sysid.estimation.initial_noise import worst_row
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.noise_estimation import SETTLED_GAIN, settle
from fish_sysid.estimation.parametrization import Array, Coordinates, Hypothesis
from fish_sysid.estimation.sensor_noise import usual_noise

ROUNDS, ROUNDS_OF_A_WRONG_MODEL = 5, 2  # of noise and parameters in turn, at most
GROWN = 2.0  # a force that more trials make so much stronger comes from a poor optimum


def fit_base(robot: Robot, experiment: Experiment) -> Fit:
    """The model as given, fitted cold on the start of every trial, continued on the whole."""
    short = shorten(experiment, FIRST_STEPS)
    noise = usual_noise(short)
    return carry_over(fit_cold(given_hypothesis(robot, short, noise), short, noise), experiment)


def led_from_nominal(hypothesis: Hypothesis, theta: Array, experiment: Experiment) -> Fit:
    """A candidate from the nominal values, its effects as in theta, led by the camera and settled on whole trials.

    From a base in a poor optimum it would stay there: a rudder that stops, rightly found, left 2300 times usual water; led so
    it leaves less than usual (docs/blind_studies.md, the nineteenth).
    """
    start, short = Coordinates(hypothesis).at_nominal(theta), shorten(experiment, FIRST_STEPS)
    led = led_by_the_camera(hypothesis, start, short, usual_noise(short), TAIL_INERTIAS)
    return carry_over(led, experiment)


def led_by_the_camera(
    hypothesis: Hypothesis,
    start: Array,
    short: Experiment,
    noise: Noise,
    held: tuple[str, ...] = (),
) -> Fit:
    """`fit_tempered` from a start, the numbers of an effect that has very many held there: what they can absorb comes after."""
    crowded, theta = crowd(hypothesis), start.copy()
    moving = np.array([free not in crowded for free in hypothesis.free])
    led = fit_tempered(hypothesis.fixing(crowded, start), short, noise, start[moving], held=held)
    theta[moving] = led.theta
    return evaluate(hypothesis, theta, short, led.noise)


def better_of(fit: Fit, led: Fit, short: Experiment, experiment: Experiment) -> Fit:
    """The fit or one led elsewhere on shortened trials, which goes on to whole ones if it is ahead of the fit settled there."""
    if led.objective - carry_over(fit, short).objective < SETTLED_GAIN:
        return fit
    return better(
        fit, settle_base(evaluate(fit.hypothesis, led.theta, experiment, led.noise), experiment)
    )


def settle_base(fit: Fit, experiment: Experiment) -> Fit:
    """`settle`, which a model that lacks something would drag on: its noise has taken in what it lacks."""
    return settle(
        fit, experiment, ROUNDS_OF_A_WRONG_MODEL if excess(fit).max() > SUSPICIOUS else ROUNDS
    )


def carry_over(fit: Fit, experiment: Experiment) -> Fit:
    """A fit of other trials, or of their first seconds, settled on these."""
    return settle_base(evaluate(fit.hypothesis, fit.theta, experiment, fit.noise), experiment)


def anneal(fit: Fit, experiment: Experiment) -> Fit:
    """The fit, or where it needs far more than usual water a better optimum that the camera alone leads to."""
    if excess(fit).max() < SUSPICIOUS:
        return fit
    short = shorten(experiment, FIRST_STEPS)
    led = led_by_the_camera(fit.hypothesis, fit.theta, short, usual_noise(experiment))
    return better_of(fit, led, short, experiment)


def reheat(fit: Fit, experiment: Experiment) -> Fit:
    """The fit, or a better optimum beside it: the IMU believed a tenth, then more and more, from where the fit is.

    The optima of a tail of five links lie so close together that the camera alone leads beside the best: one fit ended 1000
    nats below it, and left a law that is not there (docs/blind_studies.md, after the twenty-second).
    """
    noise = usual_noise(experiment)
    warm = lead(fit.hypothesis, experiment, noise, fit.theta, LEADING[-1:])
    return better(fit, settle(close(warm, experiment, noise), experiment))


def look_again(fit: Fit, experiment: Experiment) -> Fit:
    """The fit, or where it explains less than its water and sensors claim a better optimum.

    The camera leads there, the tail's inertias held about their nominal values: these had imitated a wrong phase of its swing.
    """
    if excess(fit).max() >= SUSPICIOUS or worst_row(fit) <= UNWHITE:
        return fit
    start, short = fit.theta.copy(), shorten(experiment, FIRST_STEPS)
    start[[i for i, name in enumerate(fit.hypothesis.free) if name in TAIL_INERTIAS]] = 0.0
    led = led_by_the_camera(fit.hypothesis, start, short, usual_noise(experiment), TAIL_INERTIAS)
    return better_of(fit, led, short, experiment)


def refine(fit: Fit, experiment: Experiment) -> Fit:
    """A fit carried over to other trials; where it leaves far more there, the camera leads it to a better optimum."""
    settled = carry_over(fit, experiment)
    return (
        anneal(settled, experiment)
        if excess(settled).max() > GROWN * excess(fit).max()
        else settled
    )
