# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Global fit: no single start leads to the best optimum from everywhere.

Mass and grip of the tail have many optima, the more the more links it has. Where the camera decides they lie close together,
so that many short annealings (multistart, then basin hopping: Wales and Doye 1997; as many of each as there are pairs of
links) cost less than one to the end. The best goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import comb

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.estimation.annealed_fit import Report, anneal, at_full_weight
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, better, evaluate
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.refit import ANNEAL, ANNEAL_HELD, alternate, refit
from fish_sysid.estimation.thresholds import (
    CAMERA_STAGES,
    FEW_LINKS,
    FIRST_STEPS,
    HOP_SPREAD,
    INNOVATION_RMS_SUSPECT,
    RATIO_SUSPECT,
    START_SPREAD,
)


def global_fit(hypothesis: Hypothesis, experiment: Experiment, noise: Noise) -> Fit:
    """The best of many optima.

    Where much is missing or the tail has many links, optima of the camera tell little of those at the IMU's full weight:
    there an annealing with the tail's inertias held competes.
    """
    fit = refit_if_suspect(multistart_fit(hypothesis, experiment, noise), experiment)
    right = fit.largest_ratio < RATIO_SUSPECT and fit.max_innovation_rms <= INNOVATION_RMS_SUSPECT
    if right and hypothesis.robot.links <= FEW_LINKS:
        return fit
    origin = hypothesis.parametrization.origin()
    return better(fit, refit(hypothesis, origin, experiment, noise, ANNEAL_HELD))


def multistart_fit(
    hypothesis: Hypothesis, experiment: Experiment, noise: Noise, places: Sequence[Array] = ()
) -> Fit:
    """Annealed from the best of the optima of many starts on the first seconds; the same at every call.

    places: theta (K,) to start from besides the origin and random ones.
    """
    parametrization, pairs = hypothesis.parametrization, comb(hypothesis.robot.links, 2)
    short = shorten(experiment, FIRST_STEPS)
    origin, random = parametrization.origin(), np.random.default_rng(0)

    def somewhere(count: int) -> Array:
        return parametrization.is_log * random.normal(size=(count, len(origin)))

    starts = [origin, *places, *(origin + START_SPREAD * somewhere(pairs))]
    ends = on_all_cores(
        lambda start: anneal(hypothesis, start, short, noise, CAMERA_STAGES), starts
    )
    best = reduce(better, ends)
    for step in somewhere(pairs):
        start = best.theta + HOP_SPREAD * step
        best = better(best, anneal(hypothesis, start, short, noise, CAMERA_STAGES[1:]))
    return at_full_weight(
        evaluate(hypothesis, best.theta, experiment, best.noise), experiment, noise
    )


def refit_if_suspect(fit: Fit, experiment: Experiment, report: Report = lambda _: None) -> Fit:
    """The fit, or where it needs more process noise than water: refitted, and annealed once more from there."""
    if fit.largest_ratio < RATIO_SUSPECT:
        return fit
    report("fitting, process noise and parameters in turn")
    found = alternate(fit, experiment)
    if found.largest_ratio < RATIO_SUSPECT:
        return found
    report("fitting once more from there")
    again = refit(found.hypothesis, found.theta, experiment, found.noise, ANNEAL, report)
    return better(found, again)
