"""The nominal model fitted to recordings that it may not explain: no single way leads to the best optimum then."""

from __future__ import annotations

from fish_sim.robot import Robot
from fish_train.diagnose.decide import SUSPICIOUS, excess
from fish_train.identify.experiment import Experiment
from fish_train.identify.fit import Fit, settle
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.sensor_noise import usual_noise
from fish_train.identify.tempering import fit_tempered

ROUNDS, ROUNDS_OF_A_WRONG_MODEL = 5, 2  # of noise and parameters in turn, at most


def fit_cold(robot: Robot, short: Experiment) -> Fit:
    """The best of a few ways on shortened trials: inertias held at first or not, then the camera leads a second time."""
    hypothesis, noise = nominal_hypothesis(robot), usual_noise(short)
    held = fit_tempered(hypothesis, short, noise)
    if excess(held).max() < SUSPICIOUS:
        return held
    best = better(held, fit_tempered(hypothesis, short, noise, held=()))
    return better(best, fit_tempered(hypothesis, short, best.noise, best.theta, held=()))


def settle_base(fit: Fit, experiment: Experiment) -> Fit:
    """`settle`, which a model that lacks something would drag on: its noise has taken in what it lacks."""
    return settle(fit, experiment, ROUNDS_OF_A_WRONG_MODEL if excess(fit).max() > SUSPICIOUS else ROUNDS)


def better(first: Fit, second: Fit) -> Fit:
    """The one with the higher objective."""
    return max(first, second, key=lambda fit: fit.objective)
