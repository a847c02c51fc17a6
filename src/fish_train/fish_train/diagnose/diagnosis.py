"""The whole diagnosis: identify, locate, search, decide, model, show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fish_sim.robot import Robot
from fish_train.diagnose.decide import SMALLEST_Z, Level, excess, parameter_count, strength_z
from fish_train.diagnose.locate import Description, MissingForce, describe, missing_force
from fish_train.diagnose.search import (
    RANK_STEPS,
    SUSPICIOUS,
    Round,
    evidence,
    look_alike,
    restart_base,
    search_round,
)
from fish_train.diagnose.split import Split, split_trials
from fish_train.diagnose.tail import MORE, finer_tails
from fish_train.diagnose.vocabulary import candidates, known, out_of_reach
from fish_train.identify.experiment import Experiment, shorten
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, evaluate, settle, trial_likelihoods
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.settle import suitable_noise
from fish_train.identify.tempering import fit_tempered

MOST_EFFECTS = 3
FAIR_SHARE = 0.25  # of the gain per sample that trials not fitted to must show
UNEXPLAINED_R2 = 0.3  # cross-validated; above it the remaining wrench is a force with a law, not water noise

Progress = Callable[[str], None]


def silent(_: str) -> None:
    """No progress shown."""


@dataclass(frozen=True)
class Accepted:
    """An effect that was added, and the round it won."""

    name: str
    round: Round


@dataclass(frozen=True)
class Diagnosis:
    """Everything the answer and the page are written from. Fits are on the training trials unless said otherwise."""

    experiment: Experiment
    split: Split
    robot: Robot  # as given
    nominal: Fit
    final: Fit
    rounds: tuple[Round, ...]  # on the search trials, the last one found nothing more
    accepted: tuple[Accepted, ...]
    unreachable: dict[str, str]
    level: Level
    force: MissingForce  # that the nominal model lacks
    remaining: MissingForce  # that the final model lacks
    description: Description  # of the remaining force
    held_out: dict[str, np.ndarray]  # log density per sample and held-out trial: given, nominal, final


def diagnose(
    experiment: Experiment, robot: Robot, level: Level | None = None, progress: Progress = silent,
    names: Sequence[str] | None = None,
) -> Diagnosis:  # fmt: skip
    """Answer for one experiment; `progress` gets a line at every step.

    names: what competes, by default every registered effect and sensor error; an effect of your own is registered by
    `fish_sim.effects.EFFECTS[name] = YourEffect`. Raises ValueError for a name that is not known.
    """
    level, split = level or Level(), split_trials(experiment)
    reasons = out_of_reach(experiment)
    names = known(names or candidates())
    unreachable = {name: reasons[name] for name in names if name in reasons}
    names = tuple(name for name in names if name not in reasons)
    searched = experiment.select(split.search)
    check = experiment.select(split.check) if split.check else None
    progress("fitting the nominal model")
    base = fit_base(robot, searched)
    base, rounds, accepted = grow(base, searched, check, names, level, progress)
    finer = finer_tail(rounds[0].base, base, robot, searched, check, level, progress)
    if finer is not None:
        base, rounds, accepted = grow(finer, searched, check, names, level, progress)
    progress("fitting all training trials")
    training = experiment.select(split.training)
    nominal, final = final_fits(base, rounds, training)
    final, accepted = prune(final, accepted, training, level, progress)
    progress("locating the missing force")
    force = missing_force(nominal, training)
    remaining = missing_force(final, training) if accepted else force
    progress("scoring held-out trials")
    held = held_out_density(
        experiment.select(split.held_out) if split.held_out else training, robot, nominal, final
    )
    return Diagnosis(
        experiment, split, robot, nominal, final, tuple(rounds), tuple(accepted), unreachable, level,
        force, remaining, describe(remaining), held,
    )  # fmt: skip


def fit_base(robot: Robot, experiment: Experiment) -> Fit:
    """The nominal model: a cold fit on the start of every trial, continued on the whole."""
    short = fit_tempered(nominal_hypothesis(robot), shorten(experiment, RANK_STEPS), Noise())
    return settle(evaluate(short.hypothesis, short.theta, experiment, short.noise), experiment)


def grow(
    base: Fit, experiment: Experiment, check: Experiment | None, competing: Sequence[str], level: Level,
    progress: Progress,
) -> tuple[Fit, list[Round], list[Accepted]]:  # fmt: skip
    """Add one effect at a time while one is significant."""
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    while len(accepted) < min(MOST_EFFECTS, len(competing)):
        names = [n for n in competing if n not in base.hypothesis.names]
        samples = float(base.result.samples.sum())
        found = search_round(base, names, experiment, level.enough(samples, 1, len(names)), progress)
        if found.best is not None:
            progress("refitting without it, from where it led")
            restarted = restart_base(found.base, found.refitted[found.best], experiment)
            found = Round(restarted, found.ranking, found.refitted)
        rounds.append(found)
        name = choose(found, check, len(names), level)
        if name is None:
            break
        accepted.append(Accepted(name, found))
        base = anneal(found.refitted[name], experiment)
        progress(f"found {name}: {found.gain(name):.0f} nats")
    return base, rounds, accepted


def finer_tail(
    nominal: Fit, best: Fit, robot: Robot, experiment: Experiment, check: Experiment | None, level: Level,
    progress: Progress,
) -> Fit | None:  # fmt: skip
    """The nominal model with more tail links, where the best fit leaves a strong force and this explains more of it."""
    if excess(best).max() < SUSPICIOUS:
        return None
    short = shorten(experiment, RANK_STEPS)
    finer = max(finer_tails(robot, best, experiment, short, progress), key=evidence, default=None)
    if finer is None or evidence(finer) < evidence(best):
        return None
    gain = finer.objective - nominal.objective
    if gain < level.enough(float(nominal.result.samples.sum()), 1, len(MORE)):
        return None
    if check is not None and not holds_elsewhere(nominal, finer, check):
        return None
    progress(f"the tail needs {finer.robot.links} links: {gain:.0f} nats")
    return finer


def anneal(fit: Fit, experiment: Experiment) -> Fit:
    """The fit, or where it needs far more than usual water a better optimum that the camera alone leads to."""
    if excess(fit).max() < SUSPICIOUS:
        return fit
    short = fit_tempered(fit.hypothesis, shorten(experiment, RANK_STEPS), Noise(), fit.theta)
    other = settle(evaluate(fit.hypothesis, short.theta, experiment, short.noise), experiment)
    return max(fit, other, key=lambda f: f.objective)


def choose(found: Round, check: Experiment | None, tried: int, level: Level) -> str | None:
    """The name to add: most evidence among the significant ones, the simplest of those that are as good."""
    samples = float(found.base.result.samples.sum())
    good = [
        name
        for name, fit in found.refitted.items()
        if is_significant(fit, found.gain(name), name, samples, tried, level)
        and (check is None or holds_elsewhere(found.base, fit, check))
    ]
    if not good:
        return None
    best = max(good, key=lambda name: evidence(found.refitted[name]))
    for name in good:
        extra = parameter_count(best) - parameter_count(name)
        lost = found.gain(best) - found.gain(name)
        if extra > 0 and look_alike(name, best) and lost < level.enough(samples, extra, 1):
            best = name
    return best


def is_significant(fit: Fit, gain: float, name: str, samples: float, tried: int, level: Level) -> bool:
    """Enough gain, and a strength that differs from neutral."""
    enough = level.enough(samples, parameter_count(name), tried)
    return gain > enough and strength_z(fit, name) > SMALLEST_Z


def holds_elsewhere(base: Fit, fit: Fit, check: Experiment) -> bool:
    """On trials that it was not fitted to, a fit must gain a fair share of what it gained where it was."""
    here = trial_likelihoods(fit.hypothesis, fit.theta, check, fit.noise)
    there = trial_likelihoods(base.hypothesis, base.theta, check, base.noise)
    per_sample = (here.log_likelihood.sum() - there.log_likelihood.sum()) / here.samples.sum()
    gain = fit.objective - base.objective
    return bool(per_sample > FAIR_SHARE * gain / base.result.samples.sum())


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    nominal = refine(rounds[0].base, training)
    return nominal, (refine(base, training) if base.hypothesis.names else nominal)


def refine(fit: Fit, experiment: Experiment) -> Fit:
    """A fit carried over to other trials."""
    return settle(evaluate(fit.hypothesis, fit.theta, experiment, fit.noise), experiment)


def prune(
    final: Fit, accepted: list[Accepted], training: Experiment, level: Level, progress: Progress
) -> tuple[Fit, list[Accepted]]:
    """Take effects out again that the others have made superfluous."""
    for candidate in list(accepted)[:-1] if len(accepted) > 1 else []:
        progress(f"without {candidate.name}?")
        smaller = final.hypothesis.without(candidate.name)
        keep = [i for i, f in enumerate(final.hypothesis.free) if f in smaller.free]
        fit = refine(evaluate(smaller, final.theta[keep], training, final.noise), training)
        samples = float(final.result.samples.sum())
        if final.objective - fit.objective < level.enough(samples, parameter_count(candidate.name), 1):
            final, accepted = fit, [a for a in accepted if a is not candidate]
    return final, accepted


def held_out_density(held: Experiment, robot: Robot, nominal: Fit, final: Fit) -> dict[str, np.ndarray]:
    """Log density per scalar measurement of each held-out trial: model as given, refitted, with effects."""
    noise = suitable_noise(held, robot, nominal.noise)
    given = evaluate(nominal_hypothesis(robot, ()), np.zeros(0), held, noise)
    fits = {"nominal": given, "refitted": nominal, "with_effects": final}
    density = {}
    for name, fit in fits.items():
        result = evaluate(fit.hypothesis, fit.theta, held, fit.noise).result
        density[name] = result.log_likelihood / result.samples
    return density
