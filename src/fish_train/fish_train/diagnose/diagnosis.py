"""The whole diagnosis: identify, locate, search, decide, model, show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fish_sim.robot import Robot
from fish_train.diagnose.decide import SMALLEST_Z, Level, parameter_count, strength_z
from fish_train.diagnose.locate import Description, MissingForce, describe, missing_force
from fish_train.diagnose.search import Round, restart_base, search_round
from fish_train.diagnose.split import Split, split_trials
from fish_train.diagnose.vocabulary import candidates, out_of_reach
from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, adapt_noise, climb, evaluate, fit_hypothesis, likelihood
from fish_train.identify.hypothesis import nominal_hypothesis

MOST_EFFECTS = 3
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
    experiment: Experiment, robot: Robot, level: Level | None = None, progress: Progress = silent
) -> Diagnosis:
    """Answer for one experiment; `progress` gets a line at every step."""
    level, split = level or Level(), split_trials(experiment)
    searched = experiment.select(split.search)
    unreachable = out_of_reach(experiment)
    progress("fitting the nominal model")
    base = fit_hypothesis(nominal_hypothesis(robot), searched, Noise())
    base, rounds, accepted = grow(base, searched, unreachable, level, progress)
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


def grow(
    base: Fit, experiment: Experiment, unreachable: dict[str, str], level: Level, progress: Progress
) -> tuple[Fit, list[Round], list[Accepted]]:
    """Add one effect at a time while one is significant."""
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    samples = float(base.result.samples.sum())
    while len(accepted) < MOST_EFFECTS:
        names = [n for n in candidates() if n not in base.hypothesis.names and n not in unreachable]
        enough = level.enough(samples, 1, len(names))
        found = search_round(base, names, experiment, enough, progress)
        if found.best is not None:
            found = _with_restarted_base(found, experiment)
        rounds.append(found)
        name = found.best
        if name is None or not is_significant(
            found.refitted[name], found.gain(name), name, samples, len(names), level
        ):
            break
        accepted.append(Accepted(name, found))
        base = found.refitted[name]
        progress(f"found {name}: {found.gain(name):.0f} nats")
    return base, rounds, accepted


def _with_restarted_base(found: Round, experiment: Experiment) -> Round:
    base = restart_base(found.base, [found.refitted[found.best]], experiment)
    return Round(base, found.ranking, found.refitted)


def is_significant(fit: Fit, gain: float, name: str, samples: float, tried: int, level: Level) -> bool:
    """Enough gain, and a strength that differs from neutral."""
    enough = level.enough(samples, parameter_count(name), tried)
    return gain > enough and strength_z(fit, name) > SMALLEST_Z


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    nominal = refine(rounds[0].base, training)
    return nominal, (refine(base, training) if base is not rounds[0].base and len(rounds) > 1 else nominal)


def refine(fit: Fit, experiment: Experiment) -> Fit:
    """A fit carried over to other trials."""
    start = evaluate(fit.hypothesis, fit.theta, experiment, fit.noise)
    first = climb(start, experiment, 6)
    return climb(
        evaluate(fit.hypothesis, first.theta, experiment, adapt_noise(first, experiment)), experiment, 6
    )


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
    given = evaluate(nominal_hypothesis(robot, ()), np.zeros(0), held, nominal.noise)
    fits = {"nominal": given, "refitted": nominal, "with_effects": final}
    density = {}
    for name, fit in fits.items():
        result = evaluate(fit.hypothesis, fit.theta, held, fit.noise).result
        density[name] = result.log_likelihood / result.samples
    return density


__all__ = ["Accepted", "Diagnosis", "diagnose", "likelihood"]
