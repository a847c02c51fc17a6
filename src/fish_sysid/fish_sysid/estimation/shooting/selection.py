# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which effects let a model predict trials that it was not fitted to: forward selection with left-out trials and a control.

Every round each candidate is looked at where the fit stands: what would trials left out cost after one Gauss-Newton step along
its own slope and those of the fit? The most promising are fitted from where the fit stands and judged (`left_out`). The one that
gains most joins the model if it gains more over the trials than the best of all candidates gains by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import (
    EFFECT_PRIOR,
    extend,
)
from fish_sysid.estimation.shooting.fold_steps import FOLDS, fold_of, fold_steps
from fish_sysid.estimation.shooting.huber import huber
from fish_sysid.estimation.shooting.left_out import (
    EVERY,
    Step,
    converged,
    judged,
    left_out_costs,
    step_text,
)
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.schedule import Found, multistep

Array = NDArray[np.float64]
Report = Callable[[str], None]

MOST_EFFECTS = 6
JUDGED = 4  # candidates a round that are cross-validated
GLANCE = 0.1  # strength in typical ones, at which a candidate is looked at
SCALE = 0.3  # strength at which a hypothesis is written down; sets the coordinates only
# names that move the rudder in time: data tell them apart badly, so that they are named together
RUDDER_TIMING = ("rudder_lag", "rudder_delay", "rudder_backlash", "servo_rate_limit")


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
        further, control = left_out_costs(experiment, found)
        ends = on_all_cores(
            lambda name: converged(experiment, starts(found, name), further.cost),  # noqa: B023
            promising,
        )
        fits = {name: fit for name, (fit, _) in zip(promising, ends, strict=True)}
        tried = [
            judged(name, control, costs, len(left))
            for name, (_, costs) in zip(promising, ends, strict=True)
        ]
        good = [step for step in tried if step.sure]
        best = max(good, key=lambda step: step.gain, default=None)
        steps += [
            replace(s, added=s is best, alike=_alike(s, tried) if s is best else ())
            for s in sorted(tried, key=lambda s: -s.gain)
        ]
        for step in tried:
            report(f"{step.name}: {step_text(step)}")
        if best is None:
            return further, tuple(steps)
        found = fits[best.name]
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


def starts(found: Found, name: str) -> Iterator[Found]:
    """The fit with one more effect, ever weaker."""
    return (extended(found, name, strength) for strength in (GLANCE, 0.1 * GLANCE))


def extended(found: Found, name: str, strength: float = GLANCE) -> Found:
    """The fit with one more effect at a strength in typical ones."""
    hypothesis = found.hypothesis.with_effect(name, SCALE)
    K = len(found.hypothesis.free)
    theta = extend(found.z[:K], hypothesis, name, strength)
    z = np.concatenate([theta, found.z[K:]])
    return replace(found, hypothesis=hypothesis, z=z, cost=np.inf)


def glances(experiment: Experiment, found: Found, names: Sequence[str]) -> list[str]:
    """Names in order of what trials left out would cost after one Gauss-Newton step with each, the lowest first.

    Errors are taken as linear in the fit's parameters and in the strength of the name.
    """
    base = multistep(experiment, found, EVERY)
    e, J = base.errors(found.z, base.states(found.z), slopes=True)
    promise = on_all_cores(lambda name: _promise(experiment, found, name, base, e, J), names)
    return [name for _, name in sorted(zip(promise, names, strict=True))]


def _promise(
    experiment: Experiment, found: Found, name: str, base: Multistep, e: Array, J: Array
) -> float:
    """Cost of trials left out after steps along the fit's slopes and the secant of a candidate's strength."""
    more = extended(found, name)
    sight = multistep(experiment, more, EVERY)
    with_it = sight.errors(more.z, sight.states(more.z))[0]
    secant = (with_it - e) / GLANCE
    if not np.isfinite(secant).all() or len(secant) != len(e):
        return np.inf
    z, prior = np.append(found.z, 0.0), np.append(base.prior, EFFECT_PRIOR)
    J = np.concatenate([J, secant[..., None]], axis=2)
    fold = fold_of(len(experiment.names))[base.targets.trial]
    steps = fold_steps(e, J, *base.normal(z, e, J, prior), fold)
    return float(huber(e + np.einsum("rsp,rp->rs", J, steps[fold])).sum())
