"""A cold fit that is not content with a poor optimum: no single way leads to the best one from everywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, settle
from fish_train.identify.hypothesis import Hypothesis
from fish_train.identify.tempering import fit_tempered

SUSPICIOUS = 3.0  # times the density of usual water: the fit is a poor optimum, or something is missing

Report = Callable[[str], None]


def fit_cold(
    hypothesis: Hypothesis, experiment: Experiment, noise: Noise, report: Report = lambda _: None
) -> Fit:
    """The camera leads from several values of the tail's inertias; a fit that leaves much is looked at again."""
    return second_look(fit_tempered(hypothesis, experiment, noise, report=report), experiment, report)


def second_look(fit: Fit, experiment: Experiment, report: Report = lambda _: None) -> Fit:
    """The fit, or where it leaves more than water does: settled, and then led by the camera once more from there."""
    if excess(fit).max() < SUSPICIOUS:
        return fit
    report("fitting, process noise and parameters in turn")
    settled = settle(fit, experiment)
    if excess(settled).max() < SUSPICIOUS:
        return settled
    report("fitting once more from there")
    again = fit_tempered(settled.hypothesis, experiment, settled.noise, settled.theta, report, held=())
    return better(settled, again)


def excess(fit: Fit) -> np.ndarray:
    """(3,) spectral density 2 sigma^2 tau of a fit's wrench over that of usual water, which `Noise()` describes."""
    density = [2.0 * np.square(n.wrench) * n.wrench_time for n in (fit.noise, Noise())]
    return np.asarray(density[0] / density[1])


def better(first: Fit, second: Fit) -> Fit:
    """The one with the higher objective."""
    return max(first, second, key=lambda fit: fit.objective)
