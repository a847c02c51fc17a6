"""What a fit gains on trials that it was not fitted to, its parameters no surer than the other trials made them.

log p(unseen | fitted) = log p(unseen, fitted) - log p(fitted), each by Laplace's approximation; the difference of two fits is
a partial Bayes factor (O'Hagan 1995, J. R. Stat. Soc. B 57). A prediction with the fitted values alone would blame a flow for
ground that only the unseen trials cross, where its fit had to stay open; an effect whose parameters are known gets no such grace.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.quadratic_cost import quadratic
from fish_sysid.estimation.initial_noise import open_gates
from fish_sysid.estimation.map_fit import Fit, climb, evaluate
from fish_sysid.estimation.parametrization import Coordinates

# from the optimum of some of the trials to that of all: of a flow, whose other trials cross other ground, it may be far
MOST_ITERATIONS, NEAR = 20, 1.0  # nats of a step that say it is reached


def on_all(fit: Fit, trials: Experiment) -> Fit:
    """A fit carried over from some of these trials to all, every measurement counted; its noise stays."""
    start = evaluate(fit.hypothesis, fit.theta, trials, open_gates(fit.noise))
    return climb(start, trials, MOST_ITERATIONS, NEAR)


def evidence_of(fit: Fit, trials: Sequence[int]) -> float:
    """Log evidence of some of the trials of a fit, less what is the same for any of them."""
    chosen, prior = list(trials), Coordinates(fit.hypothesis).prior
    cost = quadratic(fit.result.gradient[chosen], fit.result.normal[chosen], fit.theta, prior)
    reached = fit.log_likelihood[chosen].sum() - 0.5 * np.sum((fit.theta / prior) ** 2)
    return float(reached - cost.cost(cost.best_step([])) - 0.5 * np.linalg.slogdet(cost.normal)[1])


def predicted(fit: Fit, unseen: Sequence[int]) -> float:
    """log p(unseen | the other trials) of a fit to all."""
    everything = range(len(fit.log_likelihood))
    return evidence_of(fit, everything) - evidence_of(
        fit, [i for i in everything if i not in unseen]
    )


def gain_unseen(base: Fit, fit: Fit, unseen: Sequence[int]) -> tuple[float, float]:
    """Nats by which one fit to all trials foretells some better than another, and those that it would were it true.

    With r the whitened innovations of the fit, white if it is true, and r + d those of the base, each under its own noise, the
    gain sum((r + d)^2 - r^2) / 2 is sum(d^2) / 2 in the mean: much where the effect acts, little on trials that do not excite
    it. Where the two noises differ that is rough: the log determinants are left out of it, and d holds the change of scale.
    """
    apart = (fit.result.whitened - base.result.whitened)[:, list(unseen)]
    return predicted(fit, unseen) - predicted(base, unseen), 0.5 * float(np.nansum(apart**2))


def gain_left_out(base: Fit, fit: Fit) -> tuple[float, float]:
    """`gain_unseen` of every trial by the others, summed."""
    gains = [gain_unseen(base, fit, [i]) for i in range(len(fit.log_likelihood))]
    return sum(gain for gain, _ in gains), sum(expected for _, expected in gains)
