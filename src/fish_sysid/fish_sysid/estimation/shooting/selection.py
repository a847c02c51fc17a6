# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which effects let a model predict trials that it was not fitted to: forward selection with left-out trials and a control.

Every round each candidate is looked at where the fit stands: of its own slope and those of the fit, how far would one
Gauss-Newton step bring the cost down? The most promising are fitted without each fold of trials, from where the fit stands, and
judged on that fold against a control: the fit without the candidate, with as many iterations, so that iterations are not taken
for evidence. The one that gains most joins the model if it gains more than a standard error over the trials (Breiman et al.
1984, ch. 3.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import (
    EFFECT_PRIOR,
    extend,
)
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.schedule import Found, multistep, polished

Array = NDArray[np.float64]
Report = Callable[[str], None]

MOST_EFFECTS = 6
FOLDS = 4
JUDGED = 4  # candidates a round that are cross-validated
EVERY = 4.0  # s between start points
ROUNDS, ITERATIONS = 2, 4  # of candidate and control alike
GLANCE = 0.1  # strength in typical ones, at which a candidate is looked at
SCALE = 0.3  # strength at which a hypothesis is written down; sets the coordinates only
# names that move the rudder in time: data tell them apart badly, so that they are named together
RUDDER_TIMING = ("rudder_lag", "rudder_delay", "rudder_backlash", "servo_rate_limit")


@dataclass(frozen=True)
class Step:
    """What one candidate does to trials left out."""

    name: str
    gain: (
        float  # mean over trials left out of the logarithm of the control's cost over that with it
    )
    deviation: float  # its standard error over trials
    added: bool
    alike: tuple[str, ...] = ()  # of its family, that gain as much within a standard error


def step_text(step: Step) -> str:
    """What it does, in words."""
    return (
        f"predictions of trials left out cost {np.exp(-step.gain) - 1.0:+.0%} against as many iterations without it "
        f"(a standard error: {step.deviation:.0%})"
    )


def choose(
    experiment: Experiment,
    found: Found,
    names: Sequence[str],
    report: Report = lambda _: None,
    most: int = MOST_EFFECTS,
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit with the effects added, every candidate that was cross-validated)."""
    steps: list[Step] = []
    if len(experiment.names) < FOLDS:
        return found, ()
    for number in range(most):
        left = [name for name in names if name not in found.hypothesis.names]
        report(f"effect {number + 1}: looking at {len(left)} candidates")
        promising = glances(experiment, found, left)[:JUDGED]
        report(f"effect {number + 1}: leaving trials out for {', '.join(promising)}")
        control = left_out_costs(experiment, found)
        tried = [judge(experiment, found, name, control) for name in promising]
        good = [step for step in tried if step.gain > step.deviation]
        best = max(good, key=lambda step: step.gain, default=None)
        steps += [
            replace(s, added=s is best, alike=_alike(s, tried) if s is best else ())
            for s in sorted(tried, key=lambda s: -s.gain)
        ]
        for step in tried:
            report(f"{step.name}: {step_text(step)}")
        if best is None:
            break
        found = polished(experiment, extended(found, best.name), EVERY, ROUNDS)
    return found, tuple(steps)


def _alike(best: Step, judged: Sequence[Step]) -> tuple[str, ...]:
    """Members of the best one's family that gain as much within its standard error."""
    if best.name not in RUDDER_TIMING:
        return ()
    return tuple(
        s.name
        for s in judged
        if s is not best and s.name in RUDDER_TIMING and s.gain > best.gain - best.deviation
    )


def extended(found: Found, name: str, strength: float = GLANCE) -> Found:
    """The fit with one more effect at a strength in typical ones."""
    hypothesis = found.hypothesis.with_effect(name, SCALE)
    K = len(found.hypothesis.free)
    theta = extend(found.z[:K], hypothesis, name, strength)
    z = np.concatenate([theta, found.z[K:]])
    return replace(found, hypothesis=hypothesis, z=z, cost=np.inf)


def glances(experiment: Experiment, found: Found, names: Sequence[str]) -> list[str]:
    """Names in order of the cost to which one Gauss-Newton step with each would lead, the lowest first."""
    base = multistep(experiment, found, EVERY)
    states = base.states(found.z)
    e, J = base.errors(found.z, states, slopes=True)
    promise = {name: _promise(experiment, found, name, base, e, J) for name in names}
    return sorted(promise, key=lambda name: promise[name])


def _promise(
    experiment: Experiment, found: Found, name: str, base: Multistep, e: Array, J: Array
) -> float:
    """Cost after a step along the fit's slopes and the secant of a candidate's strength."""
    more = extended(found, name)
    sight = multistep(experiment, more, EVERY)
    with_it = sight.errors(more.z, sight.states(more.z))[0]
    secant = (with_it - e) / GLANCE
    if not np.isfinite(secant).all() or len(secant) != len(e):
        return np.inf
    z, prior = np.append(found.z, 0.0), np.append(base.prior, EFFECT_PRIOR)
    gradient, normal = base.normal(z, e, np.concatenate([J, secant[..., None]], axis=2), prior)
    return base.total(z, e, prior) - 0.5 * float(gradient @ np.linalg.solve(normal, gradient))


def left_out_costs(experiment: Experiment, found: Found) -> Array:
    """(M,) cost per prediction of each trial by parameters that were fitted, from where the fit stands, without its fold."""
    count = len(experiment.names)
    costs = np.full(count, np.nan)
    for fold in range(FOLDS):
        left_out = [m for m in range(count) if m % FOLDS == fold]
        rest = [m for m in range(count) if m % FOLDS != fold]
        fit = multistep(experiment.select(rest), found, EVERY)
        _, z = fit.improve(found.z, ROUNDS, ITERATIONS)
        unseen = multistep(experiment.select(left_out), replace(found, z=z), EVERY)
        costs[left_out] = unseen.costs_by_trial(z)
    return costs


def judge(experiment: Experiment, found: Found, name: str, control: Array) -> Step:
    """A candidate against the control's costs (M,) of trials left out."""
    return judged(name, control, left_out_costs(experiment, extended(found, name)))


def judged(name: str, control: Array, costs: Array) -> Step:
    """Costs (M,) of trials left out against those of the control: logarithms, so that no trial outweighs all others."""
    ratio = np.log(control / costs)
    ratio = ratio[np.isfinite(ratio)]
    deviation = float(np.std(ratio, ddof=1) / np.sqrt(len(ratio))) if len(ratio) > 1 else np.inf
    return Step(name, float(ratio.mean()) if len(ratio) else 0.0, deviation, False)
