"""A law for the force that a model leaves: which few terms of a free force the innovations ask for, and what they would gain.

One pass of the filter at the fit, every coefficient of `free_force` a direction, gives per trial the gradient g and the
Gauss-Newton matrix N of the cost -log likelihood along the fitted parameters and the coefficients. The force is linear in
its coefficients, so that the cost changes by g'd + d'N d / 2: terms are chosen one after the other, each with all
parameters refitted, and judged on trials that they were not chosen on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.batches import portions
from fish_sysid.diagnosis.free_force import TERMS, known_to_the_filter
from fish_sysid.diagnosis.latent_force import DOFS
from fish_sysid.diagnosis.quadratic_cost import Quadratic, quadratic
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import Coordinates, Hypothesis

MOST_TERMS = 4  # of a law
# nats that a term must gain where it is chosen: twice that is beyond chi square of one parameter in 1e-5, for 90 terms in 1e-3
SMALLEST_TERM = 10.0


@dataclass(frozen=True)
class Description:
    """A sparse law of the missing wrench, judged on trials it has not seen."""

    gain: dict[
        str, float
    ]  # degree of freedom -> nats that the law gains as a force, cross-validated
    terms: dict[str, dict[str, float]]  # degree of freedom -> term -> coefficient (SI)
    samples: float  # scalar measurements

    def lawful(self, level: Level) -> list[str]:
        """Degrees of freedom, the most lawful first, on which the law gains on unseen trials what chance does not."""
        enough = level.enough_unseen(self.samples, len(self.gain))
        return sorted(
            (dof for dof, gain in self.gain.items() if gain > enough),
            key=lambda dof: -self.gain[dof],
        )


def describe(fit: Fit, experiment: Experiment) -> Description:
    """The law of at most MOST_TERMS terms per degree of freedom that a fit leaves on the trials it was fitted to."""
    with known_to_the_filter() as name:
        hypothesis = fit.hypothesis.with_effect(name)
        theta = np.concatenate([fit.theta, np.zeros(len(hypothesis.free) - len(fit.theta))])
        gradients, normals = costs(hypothesis, theta, experiment, fit.noise)
    prior = Coordinates(fit.hypothesis).prior
    whole = quadratic(gradients, normals, fit.theta, prior)
    gains, terms = {}, {}
    for i, dof in enumerate(DOFS):
        first = len(fit.theta) + i * len(TERMS)
        offered = range(first, first + len(TERMS))
        step = whole.best_step(chosen := forward(whole, offered))
        terms[dof] = {TERMS[j - first]: float(step[j]) for j in chosen}
        gains[dof] = cross_validated(gradients, normals, fit.theta, prior, offered)
    return Description(gains, terms, float(fit.result.samples.sum()))


def costs(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise
) -> tuple[Array, Array]:
    """Gradient (M, K) and Gauss-Newton matrix (M, K, K) of every trial's -log likelihood at theta (K,)."""
    results = (
        evaluate(hypothesis, theta, experiment.select(part), noise).result
        for part in portions(experiment)
    )
    gradients, normals = zip(*((result.gradient, result.normal) for result in results), strict=True)
    return np.concatenate(gradients), np.concatenate(normals)


def forward(cost: Quadratic, offered: Sequence[int]) -> list[int]:
    """The terms that lower the cost most, one after the other while one is worth it, each with all parameters refitted."""
    chosen: list[int] = []
    left = {j for j in offered if cost.normal[j, j] > 0.0}
    reached = cost.cost(cost.best_step([]))
    while left and len(chosen) < MOST_TERMS:
        costs = {j: cost.cost(cost.best_step([*chosen, j])) for j in sorted(left)}
        best = min(costs, key=costs.__getitem__)
        if reached - costs[best] < SMALLEST_TERM:
            break
        chosen.append(best)
        left.remove(best)
        reached = costs[best]
    return chosen


def cross_validated(
    gradients: Array, normals: Array, theta: Array, prior: Array, offered: Sequence[int]
) -> float:
    """Nats that laws chosen on the other trials gain on each trial, against the parameters refitted there without one."""
    gain, trials = 0.0, np.arange(len(gradients))
    for held in trials if len(trials) > 1 else []:
        others = quadratic(gradients[trials != held], normals[trials != held], theta, prior)
        unseen = Quadratic(gradients[held], normals[held], len(theta))
        without, law = others.best_step([]), others.best_step(forward(others, offered))
        gain += unseen.cost(without) - unseen.cost(law)
    return gain
