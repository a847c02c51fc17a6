"""The whole diagnosis: identify, locate, search, decide, model, show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.backward_elimination import prune, without
from fish_sysid.diagnosis.corrected_model import much_is_left, named
from fish_sysid.diagnosis.effect_wrench import has_own_force, own_force
from fish_sysid.diagnosis.latent_force import MissingForce, missing_force
from fish_sysid.diagnosis.model_order import finer_tail
from fish_sysid.diagnosis.prediction_growth import final_fits, grow, instead_of_a_law
from fish_sysid.diagnosis.refit import fit_base, refine
from fish_sysid.diagnosis.residual_regression import describe
from fish_sysid.diagnosis.result import Accepted, Diagnosis
from fish_sysid.diagnosis.screening import Progress
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.surrogate_model import STRUCTURAL, stand_in
from fish_sysid.diagnosis.trial_split import split_trials, trials_of
from fish_sysid.diagnosis.vocabulary import (
    NoCandidateError,
    candidates,
    known,
    unjudged,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import suitable_noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis


def silent(_: str) -> None:
    """No progress shown."""


def diagnose(
    experiment: Experiment,
    robot: Robot,
    level: Level | None = None,
    progress: Progress = silent,
    names: Sequence[str] | None = None,
) -> Diagnosis:
    """Answer for one experiment; `progress` gets a line at every step.

    names: what competes, by default all of `candidates()`; an effect of your own is registered by
    `fish_sim.effects.EFFECTS[name] = YourEffect`. Raises ValueError for a name that is not known,
    NoCandidateError if none of the names can be judged.
    """
    level, split = level or Level(), split_trials(experiment)
    names = known(names or candidates())
    trials = trials_of(experiment, split)
    unreachable = {
        name: why for name, why in unjudged(trials.training, robot).items() if name in names
    }
    names = tuple(name for name in names if name not in unreachable)
    if not names:
        reasons = "; ".join(f"{name}: {why}" for name, why in unreachable.items())
        raise NoCandidateError(f"no candidate is left that could be judged ({reasons})")
    progress("fitting the nominal model")
    base = fit_base(robot, trials.searched)
    base, rounds, accepted = grow(base, trials, names, level, progress)
    progress("fitting all training trials")
    training = trials.training
    nominal, final = final_fits(base, rounds, training)
    law = describe(final, training)
    finer = finer_tail(rounds[0].base, base, law, robot, trials, level, progress)
    if finer is not None:
        base, rounds, accepted = grow(finer, trials, names, level, progress)
        nominal, final = final_fits(base, rounds, training)
        law = describe(final, training)
    described = final
    if not accepted:
        accepted = instead_of_a_law(rounds[-1], law, trials, level, progress)
        final = refine(accepted[0].contest[accepted[0].name], training) if accepted else nominal
    final, accepted = prune(final, accepted, training, level, progress)
    law = law if final is described else describe(final, training)
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
        experiment,
        split,
        robot,
        nominal,
        final,
        tuple(rounds),
        tuple(accepted),
        unreachable,
        level,
        force,
        parts,
        pushes,
        remaining,
        law,
        given_noise,
        held,
    )
    if named(found) or not much_is_left(found):
        return found
    helpful = dict.fromkeys((*(a.name for a in accepted), *(n for n in STRUCTURAL if n in names)))
    return replace(found, outlook=stand_in(nominal, tuple(helpful), training, progress, names))


def shares(
    final: Fit, accepted: Sequence[Accepted], training: Experiment
) -> dict[str, tuple[Fit, MissingForce]]:
    """Of several effects each one's part: the model less it, with the noise it then needs, and the force that it lacks."""

    def part(name: str) -> tuple[Fit, MissingForce]:
        less = without(final, name, training)
        return less, missing_force(less, training)

    names = [a.name for a in accepted] if len(accepted) > 1 else []
    return dict(zip(names, on_all_cores(part, names), strict=True))


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
