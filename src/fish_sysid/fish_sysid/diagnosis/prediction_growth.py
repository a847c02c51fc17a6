"""A model that grows by one effect at a time while one is significant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.backward_elimination import simplest
from fish_sysid.diagnosis.cross_validation import gain_left_out, gain_unseen, on_all
from fish_sysid.diagnosis.forward_selection import (
    Round,
    evidence,
    look_alike,
    settled_round,
)
from fish_sysid.diagnosis.refit import anneal, refine
from fish_sysid.diagnosis.residual_regression import Description
from fish_sysid.diagnosis.result import Accepted
from fish_sysid.diagnosis.screening import Progress
from fish_sysid.diagnosis.significance import (
    SMALLEST_CHECK,
    SMALLEST_Z,
    Level,
    parameter_count,
    strength_z,
)
from fish_sysid.diagnosis.trial_split import Trials
from fish_sysid.estimation.map_fit import Fit

MOST_EFFECTS = 3
FAIR_SHARE = 0.5  # of the gain that a true effect shows on trials not fitted to: half-way to it


def grow(
    base: Fit, trials: Trials, competing: Sequence[str], level: Level, progress: Progress
) -> tuple[Fit, list[Round], list[Accepted]]:
    """Add one effect at a time while one is significant."""
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    experiment = trials.searched
    while len(accepted) < min(MOST_EFFECTS, len(competing)):
        names = [n for n in competing if n not in base.hypothesis.names]
        samples = float(base.result.samples.sum())
        needed = {name: level.enough(samples, parameter_count(name), len(names)) for name in names}
        found = settled_round(base, needed, experiment, progress)
        base = found.base  # or the better optimum of the same model that a candidate led to
        rounds.append(found)
        name = choose(found, trials, len(names), level)
        if name is None:
            break
        accepted.append(Accepted(name, found, found.refitted))
        base = anneal(found.refitted[name], experiment)
        progress(f"found {name}: {found.gain(name):.0f} nats")
    return base, rounds, accepted


def choose(found: Round, trials: Trials, tried: int, level: Level) -> str | None:
    """The name to add: most evidence among the significant ones that the check confirms, the simplest of those as good.

    A look-alike that is better everywhere takes its place (`overtaken`).
    """
    samples = float(found.base.result.samples.sum())
    good = significant(found, samples, tried, level)
    base = on_all(found.base, trials.training) if good else found.base
    confirmed = {
        name: found.refitted[name]
        for name in good
        if holds_elsewhere(base, found.refitted[name], trials, tried, level)
    }
    if not confirmed:
        return None
    best = simplest(max(confirmed, key=lambda name: evidence(confirmed[name])), confirmed, level)
    rivals = {n: found.refitted[n] for n in good if n not in confirmed and look_alike(n, best)}
    return overtaken(best, confirmed[best], rivals, base, trials)


def overtaken(name: str, fit: Fit, rivals: Mapping[str, Fit], base: Fit, trials: Trials) -> str:
    """The name, or the look-alike that leads it on the trials of the search and on those of the check as well.

    A look-alike whose form is not quite the true one promises more than it keeps; a poorer one keeps its smaller promise.
    """
    for other, rival in rivals.items():
        if evidence(rival) > evidence(fit):
            foretold = [
                gain_unseen(base, on_all(f, trials.training), trials.check)[0] for f in (rival, fit)
            ]
            if foretold[0] - foretold[1] > SMALLEST_CHECK:
                name, fit = other, rival
    return name


def significant(found: Round, samples: float, tried: int, level: Level) -> list[str]:
    """Refitted names with enough gain, and a strength that differs from neutral."""
    return [
        name
        for name, fit in found.refitted.items()
        if found.gain(name) > level.enough(samples, parameter_count(name), tried)
        and strength_z(fit, name) > SMALLEST_Z
    ]


def holds_elsewhere(base: Fit, fit: Fit, trials: Trials, tried: int, level: Level) -> bool:
    """Whether a fit foretells trials that it was not fitted to, better than the base on all trials does.

    A fair share of what it would gain on the check if it were true; where the check is too calm for that, enough on every
    training trial in turn.
    """
    everywhere = on_all(fit, trials.training)
    gain, expected = gain_unseen(base, everywhere, trials.check)
    if expected < SMALLEST_CHECK:
        return gain_left_out(base, everywhere)[0] > level.enough_unseen(
            float(base.result.samples.sum()), tried
        )
    return gain > max(FAIR_SHARE * expected, SMALLEST_CHECK)


def instead_of_a_law(
    found: Round, law: Description, trials: Trials, level: Level, progress: Progress
) -> list[Accepted]:
    """The name that foretells every training trial from the others as well as the law that the nominal fit leaves there does.

    For where no name gained enough on the searched trials alone and yet a law is left on all: it is called unexplained only
    if it foretells better than the names. These keep a fair share of their promise on all; on the two or three of the check
    so little is a matter of luck.
    """
    lawful = law.lawful(level)
    if not lawful or not found.refitted:
        return []
    base, tried = on_all(found.base, trials.training), len(found.ranking)
    needed = max(
        sum(law.gain[dof] for dof in lawful) - SMALLEST_CHECK,
        level.enough_unseen(law.samples, tried),
    )
    foretold = {}
    for name, fit in found.refitted.items():
        gain, expected = gain_left_out(base, on_all(fit, trials.training))
        if strength_z(fit, name) > SMALLEST_Z and gain > FAIR_SHARE * expected:
            foretold[name] = gain
    good = {name: found.refitted[name] for name, nats in foretold.items() if nats > needed}
    if not good:
        return []
    name = simplest(max(good, key=lambda name: evidence(good[name])), good, level)
    progress(f"found {name} instead of a law: {foretold[name]:.0f} nats on trials left out")
    return [Accepted(name, found, found.refitted, foretold[name])]


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    if base.hypothesis.names == rounds[0].base.hypothesis.names:
        nominal = refine(base, training)
        return nominal, nominal
    nominal, final = on_all_cores(lambda fit: refine(fit, training), [rounds[0].base, base])
    return nominal, final
