"""The whole diagnosis: identify, locate, search, decide, model, show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fish_sim.robot import Robot
from fish_train.diagnose.base import settle_base
from fish_train.diagnose.decide import SMALLEST_CHECK, SMALLEST_Z, Level, parameter_count, strength_z
from fish_train.diagnose.law import Description, describe
from fish_train.diagnose.locate import MissingForce, missing_force
from fish_train.diagnose.own_force import has_own_force, own_force
from fish_train.diagnose.search import (
    RANK_STEPS,
    Round,
    evidence,
    look_alike,
    settled_round,
)
from fish_train.diagnose.split import Split, split_trials
from fish_train.diagnose.tail import MORE, finer_tails
from fish_train.diagnose.verdict import much_is_left, named
from fish_train.diagnose.vocabulary import candidates, known, out_of_reach
from fish_train.identify.cold import SUSPICIOUS, better, excess, fit_cold
from fish_train.identify.experiment import Experiment, shorten
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, adapt_noise, evaluate, settle, trial_likelihoods
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.outlook import fit_outlook
from fish_train.identify.sensor_noise import usual_noise
from fish_train.identify.settle import open_gates, suitable_noise
from fish_train.identify.tempering import fit_tempered

MOST_EFFECTS = 3
GROWN = 2.0  # a force that more trials make so much stronger comes from a poor optimum
FAIR_SHARE = 0.5  # of the gain that a true effect shows on trials not fitted to: half-way to it

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
    parts: dict[
        str, tuple[Fit, MissingForce]
    ]  # of several effects: the final model less one, and what it then lacks
    pushes: dict[str, MissingForce]  # of the accepted effects that push: what they do in the final model
    remaining: MissingForce  # that the final model lacks
    description: Description  # of the remaining force
    given_noise: Noise  # that suits the robot as given: at the refitted noise its filter would lose the fish
    held_out: dict[str, np.ndarray]  # log density per sample and held-out trial: given, nominal, final
    outlook: Fit | None = (
        None  # where much is left and no name fits: the nominal structure that predicts best
    )

    @property
    def unseen(self) -> Experiment:
        """The held-out trials, or where there are too few the training trials."""
        return self.experiment.select(self.split.held_out or self.split.training)


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
    parts = shares(final, accepted, training)
    pushes = {a.name: own_force(final, a.name, training) for a in accepted if has_own_force(a.name)}
    progress("scoring held-out trials")
    unseen = experiment.select(split.held_out or split.training)
    given_noise = suitable_noise(unseen, robot, nominal.noise)
    held = held_out_density(unseen, robot, given_noise, nominal, final)
    found = Diagnosis(
        experiment, split, robot, nominal, final, tuple(rounds), tuple(accepted), unreachable, level,
        force, parts, pushes, remaining, describe(final, training), given_noise, held,
    )  # fmt: skip
    if named(found) or not much_is_left(found):
        return found
    # a likelihood misleads about a model that lacks something without a name: its parameters go where the next 50 ms are right
    progress("no name fits: fitting the nominal model to predict over seconds")
    return replace(found, outlook=fit_outlook(nominal, training, progress))


def fit_base(robot: Robot, experiment: Experiment) -> Fit:
    """The nominal model: cold fit on the start of every trial, continued on the whole."""
    short = shorten(experiment, RANK_STEPS)
    cold = fit_cold(nominal_hypothesis(robot), short, usual_noise(short))
    return settle_base(evaluate(cold.hypothesis, cold.theta, experiment, cold.noise), experiment)


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
        found = settled_round(base, names, experiment, level.enough(samples, 1, len(names)), progress)
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
    """The nominal model with more tail links, where the best fit leaves more than water and this explains more of it."""
    if excess(best).max() < SUSPICIOUS:
        return None
    short = shorten(experiment, RANK_STEPS)
    finer = max(finer_tails(robot, nominal, best, experiment, short, progress), key=evidence, default=None)
    if finer is None or evidence(finer) < evidence(best) or excess(finer).max() > excess(best).max():
        return None
    gain = finer.objective - nominal.objective
    if gain < level.enough(float(nominal.result.samples.sum()), 1, len(MORE)):
        return None
    # half of what the truth would gain there is too much to ask: no number of links is the truth, and none is a name
    if check is not None and not gain_elsewhere(nominal, finer, check)[0] > SMALLEST_CHECK:
        return None
    progress(f"the tail needs {finer.robot.links} links: {gain:.0f} nats")
    return finer


def anneal(fit: Fit, experiment: Experiment) -> Fit:
    """The fit, or where it needs far more than usual water a better optimum that the camera alone leads to."""
    if excess(fit).max() < SUSPICIOUS:
        return fit
    noise, short = usual_noise(experiment), shorten(experiment, RANK_STEPS)
    short_fit = fit_tempered(fit.hypothesis, short, noise, fit.theta, held=())
    other = settle(evaluate(fit.hypothesis, short_fit.theta, experiment, short_fit.noise), experiment)
    return better(fit, other)


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
    """On trials that it was not fitted to, a fit must gain a fair share of what it would gain there if it were true."""
    gain, expected = gain_elsewhere(base, fit, check)
    return gain > max(FAIR_SHARE * expected, SMALLEST_CHECK)


def gain_elsewhere(base: Fit, fit: Fit, check: Experiment) -> tuple[float, float]:
    """Nats that a fit gains over the base on trials that neither was fitted to, and those that it would if it were true.

    With r the whitened innovations of the fit, white if it is true, and r + d those of the base under the same noise, the gain
    sum((r + d)^2 - r^2) / 2 is sum(d^2) / 2 in the mean: much where the effect acts, little on trials that do not excite it.
    """
    noise = open_gates(fit.noise)
    here = trial_likelihoods(fit.hypothesis, fit.theta, check, noise)
    there = trial_likelihoods(base.hypothesis, base.theta, check, noise)
    gain = float(here.log_likelihood.sum() - there.log_likelihood.sum())
    return gain, 0.5 * float(np.nansum((here.whitened - there.whitened) ** 2))


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    if not base.hypothesis.names:
        nominal = refine(base, training)
        return nominal, nominal
    return refine(rounds[0].base, training), refine(base, training)


def refine(fit: Fit, experiment: Experiment) -> Fit:
    """A fit carried over to other trials; where it leaves far more there, the camera leads it to a better optimum."""
    settled = settle_base(evaluate(fit.hypothesis, fit.theta, experiment, fit.noise), experiment)
    return anneal(settled, experiment) if excess(settled).max() > GROWN * excess(fit).max() else settled


def prune(
    final: Fit, accepted: list[Accepted], training: Experiment, level: Level, progress: Progress
) -> tuple[Fit, list[Accepted]]:
    """Take effects out again that the others have made superfluous."""
    for candidate in list(accepted)[:-1] if len(accepted) > 1 else []:
        progress(f"without {candidate.name}?")
        fit = refine(switched_off(final, candidate.name, training), training)
        samples = float(final.result.samples.sum())
        if final.objective - fit.objective < level.enough(samples, parameter_count(candidate.name), 1):
            final, accepted = fit, [a for a in accepted if a is not candidate]
    return final, accepted


def switched_off(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect, its other parameters as they are."""
    smaller = fit.hypothesis.without(name)
    keep = [i for i, free in enumerate(fit.hypothesis.free) if free in smaller.free]
    return evaluate(smaller, fit.theta[keep], experiment, fit.noise)


def shares(
    final: Fit, accepted: Sequence[Accepted], training: Experiment
) -> dict[str, tuple[Fit, MissingForce]]:
    """Of several effects each one's part: the model less it, with the noise it then needs, and the force that it lacks."""
    found = {}
    for name in [a.name for a in accepted] if len(accepted) > 1 else []:
        less = switched_off(final, name, training)
        less = evaluate(less.hypothesis, less.theta, training, adapt_noise(less, training))
        found[name] = less, missing_force(less, training)
    return found


def held_out_density(
    held: Experiment, robot: Robot, given_noise: Noise, nominal: Fit, final: Fit
) -> dict[str, np.ndarray]:
    """Log density per scalar measurement of each held-out trial: model as given, refitted, with effects."""
    given = evaluate(nominal_hypothesis(robot, ()), np.zeros(0), held, given_noise)
    fits = {"nominal": given, "refitted": nominal, "with_effects": final}
    density = {}
    for name, fit in fits.items():
        result = evaluate(fit.hypothesis, fit.theta, held, fit.noise).result
        density[name] = result.log_likelihood / result.samples
    return density
