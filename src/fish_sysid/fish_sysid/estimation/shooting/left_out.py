# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an effect does to trials that the model was not fitted to, against a control.

A fit goes on for a few iterations from where it stands and predicts every fold of trials by its parameters without that fold. The
control is the same fit without the effect, with as many iterations, so that iterations are not taken for evidence. Parameters
without a fold are one Gauss-Newton step from those of all trials:

    z_f = z - (N - sum over f of J' W J)^-1 (g - sum over f of J' W e)

N, g: Gauss-Newton matrix and gradient of all trials, with the prior. Near the optimum this is the fit to the rest of the trials
to second order, at a fraction of the time (Beirami et al. 2017; Giordano et al. 2019).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, sem, t

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.shooting.least_squares import weight
from fish_sysid.estimation.shooting.multistep import LARGEST_STEP, SETTLED, Multistep
from fish_sysid.estimation.shooting.schedule import Found, multistep

Array = NDArray[np.float64]

FOLDS = 4
DAMPINGS = (0.0, 0.01, 0.1, 1.0)
EVERY = 4.0  # s between start points
LEVEL = float(norm.sf(2.0))  # probability that chance lets any of the effects looked at gain enough
ROUNDS, ITERATIONS = 2, 2  # of a fit and its control alike


def fold_of(trials: int) -> NDArray[np.int64]:
    """(M,) which fold each of so many trials is in."""
    return np.arange(trials) % FOLDS


def fold_steps(
    e: Array,
    J: Array,
    gradient: Array,
    normal: Array,
    fold: NDArray[np.int64],
    damping: float = 0.0,
) -> Array:
    """(F, P) Gauss-Newton steps of the cost without the rows of each fold.

    e: (R, 4) errors; J: (R, 4, P) slopes; gradient (P,) and normal (P, P) of the whole cost; fold: (R,) that of each row;
    damping: of the diagonal (Marquardt 1963).
    """
    weighted, out = weight(e), []
    for f in range(fold.max() + 1):
        own, w, rows = e[fold == f], weighted[fold == f], J[fold == f]
        rest = normal - np.einsum("rsp,rs,rsq->pq", rows, w, rows)
        rest += damping * np.diag(np.diag(rest))
        out.append(-np.linalg.solve(rest, gradient - np.einsum("rsp,rs->p", rows, w * own)))
    clipped: Array = np.clip(np.array(out), -LARGEST_STEP, LARGEST_STEP)
    return clipped


def without_folds(cost: Multistep, z: Array, states: Array) -> Array:
    """(F, P) parameters without each fold of trials, from z (P,) and its start states (S, NS).

    Of steps with more and more damping the one that lowers the cost of the rest of the trials most.
    """
    e, J = cost.errors(z, states, slopes=True)
    fold = fold_of(len(cost.experiment.names))[cost.targets.trial]
    gradient, normal = cost.normal(z, e, J)
    steps = np.stack([fold_steps(e, J, gradient, normal, fold, d) for d in DAMPINGS], axis=1)
    steps[..., cost.imu_clock] = 0.0
    out = []
    for f, own in enumerate(steps):
        tried = [cost.clip(z + step) for step in own]
        sizes = [cost.total(t, cost.errors(t, states)[0][fold != f]) for t in tried]
        out.append(tried[int(np.argmin(sizes))])
    return np.array(out)


@dataclass(frozen=True)
class Step:
    """What one effect does to trials left out."""

    name: str
    gain: float  # mean over trials of the logarithm of the cost without it over that with it
    deviation: float  # its standard error over trials
    asked: float  # standard errors that it must gain
    p_value: float = float("nan")  # of the best of so many gains by chance
    added: bool = False
    alike: tuple[str, ...] = ()  # of its family, that gain as much within a standard error

    @property
    def sure(self) -> bool:
        """Whether it gains more than chance."""
        return self.gain > self.asked * self.deviation


def standard_errors_asked(trials: int, looked_at: int = 1) -> float:
    """Standard errors of a mean over so many trials that the best of so many effects passes with probability LEVEL by chance.

    Student's t, as the standard error is estimated from the trials, with Bonferroni's correction.
    """
    return float(t.isf(LEVEL / looked_at, max(trials - 1, 1)))


def step_text(step: Step) -> str:
    """What it does, in words."""
    return (
        f"predictions of trials left out cost {np.exp(-step.gain) - 1.0:+.0%} against as many iterations without it "
        f"(a standard error: {step.deviation:.0%}; asked: {step.asked:.1f} of them)"
    )


def left_out_costs(experiment: Experiment, found: Found) -> tuple[Found, Array]:
    """(the fit a few iterations on, (M,) cost per prediction of each trial by its parameters without the trial's fold).

    NaN for a trial that is too short for a prediction.
    """
    cost = multistep(experiment, found, EVERY)
    size, z = cost.improve(found.z, ROUNDS, ITERATIONS)
    fold, costs = fold_of(len(experiment.names)), np.full(len(experiment.names), np.nan)
    for f, without in enumerate(without_folds(cost, z, cost.states(z))):
        left_out = [m for m in np.flatnonzero(fold == f).tolist() if m in cost.targets.trial]
        if not left_out:
            continue
        unseen = multistep(experiment.select(left_out), replace(found, z=without), EVERY)
        costs[left_out] = unseen.costs_by_trial(without)
    return replace(found, z=z, cost=size), costs


def converged(
    experiment: Experiment, starts: Iterable[Found], contained: float
) -> tuple[Found, Array]:
    """`left_out_costs` from the first of these starts that ends as low as a fit which it contains, or else from the best.

    contained: cost of that fit. One that ends higher has not converged, and starts again.
    """
    ended: list[tuple[Found, Array]] = []
    for start in starts:
        ended.append(left_out_costs(experiment, start))
        if ended[-1][0].cost <= (1.0 + SETTLED) * contained:
            break
    return min(ended, key=lambda one: one[0].cost)


def judged(name: str, control: Array, costs: Array, looked_at: int = 1) -> Step:
    """Costs (M,) of trials left out with an effect against those of the control without it.

    Logarithms, so that no trial outweighs all others. looked_at: effects of which this one is the most promising.
    """
    ratio = np.log(control / costs)
    ratio = ratio[np.isfinite(ratio)]
    deviation = float(sem(ratio)) if len(ratio) > 1 else np.inf
    gain = float(ratio.mean()) if len(ratio) else 0.0
    chance = (
        t.sf(gain / deviation, max(len(ratio) - 1, 1)) if deviation > 0.0 else float(gain <= 0.0)
    )
    p_value = min(1.0, looked_at * float(chance))
    return Step(name, gain, deviation, standard_errors_asked(len(ratio), looked_at), p_value)
