# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a model gets because trials left out ask for it: effects one by one or all at once, and an end of the rudder.

Forward: every round each candidate is looked at where the fit stands: what would trials left out cost after one Gauss-Newton step
along its own slope and those of the fit? The most promising are fitted from where the fit stands and judged (`left_out`). The one
that gains most joins the model if it gains more over the trials than the best of all candidates gains by chance.

Backward: several things that a model lacks bend a fit that has none of them, and none of them helps such a fit alone. So what a
fish's body and actuators may have at all times and places is fitted at once, and each effect must then earn its place.

The rudder's end, when commands go beyond the range that the robot's file states: the largest command of the training trials says
nothing of an end. A range put there would stop the rudder in other trials, where the real one went on. The rudder therefore has
no end, unless trials left out are predicted better with one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import (
    EFFECT_PRIOR,
    Hypothesis,
    extend,
)
from fish_sysid.estimation.shooting.least_squares import huber
from fish_sysid.estimation.shooting.left_out import (
    EVERY,
    FOLDS,
    Step,
    converged,
    fold_of,
    fold_steps,
    judged,
    left_out_costs,
    step_text,
)
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.schedule import Found, multistep

Array = NDArray[np.float64]
Report = Callable[[str], None]

MOST_EFFECTS = 6
JUDGED = 4  # candidates a round that are cross-validated
GLANCE = 0.1  # strength in typical ones, at which a candidate is looked at
SCALE = 0.3  # strength at which a hypothesis is written down; sets the coordinates only
# names that move the rudder in time: data tell them apart badly, so that they are named together
RUDDER_TIMING = ("rudder_lag", "rudder_delay", "rudder_backlash", "servo_rate_limit")
# no memory, no delay, no place in the pool
INTRINSIC = (
    "quadratic_drag",
    "tip_slip",
    "hull_asymmetry",
    "tail_hardening",
    "tail_joint_damping",
    "rotor_imbalance",
    "rudder_gain",
    "rudder_offset",
    "rudder_placement",
)
RANGE = "rudder_range"
WIDEST = np.pi / 2  # rad, the largest range of a robot's file: no end
# of the largest command: where an end that is tried starts, so that commands beyond it move it
BELOW = (0.8, 0.95)


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
        reached = on_all_cores(
            lambda name: converged(experiment, starts(found, name), further.cost),  # noqa: B023
            promising,
        )
        fits = {name: fit for name, (fit, _) in zip(promising, reached, strict=True)}
        tried = [
            judged(name, control, costs, len(left))
            for name, (_, costs) in zip(promising, reached, strict=True)
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


def eliminate(
    experiment: Experiment, found: Found, names: Sequence[str], report: Report = lambda _: None
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit with those of `names` that trials left out ask for, what each of them does).

    The effect that gains least goes while one gains less than chance may let it gain (`standard_errors_asked`).
    """
    steps: dict[str, Step] = {}
    unsure = list(names) if len(experiment.names) >= FOLDS else []
    while unsure:
        report(f"leaving trials out, without {', '.join(unsure)} in turn")
        further, control = left_out_costs(experiment, found)
        fewer = [without(found, name) for name in unsure]
        tried = on_all_cores(lambda fit: left_out_costs(experiment, fit), fewer)
        fits = {}
        for name, (fits[name], costs) in zip(unsure, tried, strict=True):
            steps[name] = replace(judged(name, costs, control), added=True)
            report(f"{name}: {step_text(steps[name])}")
        unsure = [name for name in unsure if not steps[name].sure]
        if not unsure:
            return further, tuple(steps.values())
        worst = min(unsure, key=lambda name: steps[name].gain)
        found, steps[worst] = fits[worst], replace(steps[worst], added=False)
        unsure.remove(worst)
    return found, tuple(steps.values())


def without(found: Found, name: str) -> Found:
    """The fit less one effect, everything else as it is."""
    stays = np.concatenate([~found.hypothesis.own(name), np.ones(len(SENSORS), dtype=bool)])
    return replace(found, hypothesis=found.hypothesis.without(name), z=found.z[stays], cost=np.inf)


def largest_command(experiment: Experiment) -> float:
    """The largest rudder command, to either side [rad]."""
    return float(np.abs(experiment.given_commands[:, 1]).max())


def without_false_end(robot: Robot, experiment: Experiment) -> Robot:
    """The robot, its rudder without an end where commands go beyond its range."""
    if largest_command(experiment) <= robot.parameters[RANGE]:
        return robot
    return robot.with_parameters(**{RANGE: WIDEST})


def with_end(hypothesis: Hypothesis, end: float) -> Hypothesis:
    """The hypothesis with a rudder that ends at `end` [rad], free."""
    robot = hypothesis.robot.with_parameters(**{RANGE: end})
    return replace(hypothesis, robot=robot, free=(*hypothesis.free, RANGE))


def judged_end(
    experiment: Experiment, found: Found, report: Callable[[str], None] = lambda _: None
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit, its rudder with an end if trials left out ask for one, what was judged).

    Nothing is judged where the rudder's range is the one of the robot's file, or where there are too few trials.
    """
    if found.hypothesis.robot.parameters[RANGE] < WIDEST or len(experiment.names) < FOLDS:
        return found, ()
    report("does the rudder end below its commands?")
    found, control = left_out_costs(experiment, found)
    tried = ends(found, largest_command(experiment))
    ended, costs = converged(experiment, tried, found.cost)
    step = judged(RANGE, control, costs)
    step = replace(step, added=step.sure)
    report(f"{RANGE}: {step_text(step)}")
    return (ended if step.added else found), (step,)


def ends(found: Found, largest: float) -> Iterator[Found]:
    """The fit with an end of the rudder, ever nearer to the largest command [rad], or to WIDEST where commands go beyond."""
    z = np.insert(found.z, len(found.z) - len(SENSORS), 0.0)
    hypotheses = (with_end(found.hypothesis, below * min(largest, WIDEST)) for below in BELOW)
    return (replace(found, hypothesis=hypothesis, z=z) for hypothesis in hypotheses)
