"""A cold fit that is not content with a poor optimum: no single way leads to the best one from everywhere.

How heavy the tail is and how the water holds it have many optima, the more the more links it has. Where the camera leads
they lie close together, so that many short ways to there (multistart, then basin hopping: Wales and Doye 1997; as many of
each as there are pairs of links) cost less than one way to the end; the best goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import comb

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.estimation.annealed_fit import (
    LEADING,
    TAIL_INERTIAS,
    Report,
    close,
    fit_tempered,
    lead,
)
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.initial_noise import worst_row
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import Coordinates, Hypothesis

FIRST_STEPS = 800  # of 10 ms: eight seconds of every trial are enough to begin with, and to rank
SPREAD, HOP = (
    0.2,
    0.1,
)  # how far a start and a hop are off: of the logarithms of the nominal parameters
FEW_LINKS = (
    3  # of a tail with so few optima that one which leaves no more than water does is the best
)
SUSPICIOUS = (
    3.0  # times the density of usual water: the fit is a poor optimum, or something is missing
)
# rms of whitened innovations, 1 where all is right: a fit that needs no strong water and still leaves more is a poor optimum
# (one 8000 nats below the truth: 1.46, at the truth: 1.05; docs/blind_studies.md, the eighteenth)
UNWHITE = 1.2
# five times the standard deviation of usual water, more than the noisiest pool that is still a pool: something is missing
TOO_STRONG = 30.0


def fit_cold(
    hypothesis: Hypothesis,
    experiment: Experiment,
    noise: Noise,
    report: Report = lambda _: None,
    places: Sequence[Array] = (),
) -> Fit:
    """The best of many optima; a fit that leaves much is looked at again. places: (K,) theta to begin at besides.

    Where much is missing, or the tail has many links, optima where the camera leads tell little of those at the IMU's full
    weight: there another way competes, the tail's inertias held at several values until then. Either has ended thousands
    of nats below the other, and one a thousand below that left no more than water does.
    """
    fit = second_look(
        fit_multistart(hypothesis, experiment, noise, report, places), experiment, report
    )
    right = excess(fit).max() < SUSPICIOUS and worst_row(fit) <= UNWHITE
    if right and hypothesis.robot.links <= FEW_LINKS:
        return fit
    return better(
        fit, fit_tempered(hypothesis, experiment, noise, report=report, held=TAIL_INERTIAS)
    )


def fit_multistart(
    hypothesis: Hypothesis,
    experiment: Experiment,
    noise: Noise,
    report: Report = lambda _: None,
    places: Sequence[Array] = (),
) -> Fit:
    """`fit_tempered` from the best of the optima that the camera leads to on the first seconds; the same at every call."""
    coordinates, pairs = Coordinates(hypothesis), comb(hypothesis.robot.links, 2)
    short = shorten(experiment, FIRST_STEPS)
    origin, random = coordinates.origin(), np.random.default_rng(0)

    def somewhere(count: int) -> Array:
        return coordinates.is_log * random.normal(size=(count, len(origin)))

    report("fitting, the camera leads from many places")
    starts = [origin, *places, *(origin + SPREAD * somewhere(pairs))]
    best = reduce(better, on_all_cores(lambda start: lead(hypothesis, short, noise, start), starts))
    for step in somewhere(pairs):
        best = better(best, lead(hypothesis, short, noise, best.theta + HOP * step, LEADING[1:]))
    return close(
        evaluate(hypothesis, best.theta, experiment, best.noise), experiment, noise, report
    )


def second_look(fit: Fit, experiment: Experiment, report: Report = lambda _: None) -> Fit:
    """The fit, or where it leaves more than water does: settled, and then led by the camera once more from there."""
    if excess(fit).max() < SUSPICIOUS:
        return fit
    report("fitting, process noise and parameters in turn")
    settled = settle(fit, experiment)
    if excess(settled).max() < SUSPICIOUS:
        return settled
    report("fitting once more from there")
    again = fit_tempered(settled.hypothesis, experiment, settled.noise, settled.theta, report)
    return better(settled, again)


def excess(fit: Fit) -> np.ndarray:
    """(3,) spectral density 2 sigma^2 tau of a fit's wrench over that of usual water, which `Noise()` describes."""
    density = [2.0 * np.square(n.wrench) * n.wrench_time for n in (fit.noise, Noise())]
    return np.asarray(density[0] / density[1])


def better(first: Fit, second: Fit) -> Fit:
    """The one with the higher objective; one that has none is none."""
    return (
        second if second.objective > first.objective or not np.isfinite(first.objective) else first
    )
