# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The method on one page: symmetries, fit, select effects, choose the number of links, eliminate, say what is left.

Where the model cannot follow the fish at all there is no search: what is left is located, and predictions over seconds choose.
"""

from __future__ import annotations

import operator
from collections.abc import Collection, Sequence
from dataclasses import replace

from fish_report.parallel import on_all_cores
from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.backward_elimination import eliminate
from fish_sysid.diagnosis.can_follow import missed_by
from fish_sysid.diagnosis.conclusion import by_predictions, conclude, with_surrogate
from fish_sysid.diagnosis.corrected_model import of_search
from fish_sysid.diagnosis.forward_selection import Selection, select_effects
from fish_sysid.diagnosis.model_order import better_order
from fish_sysid.diagnosis.residual_regression import residual_law
from fish_sysid.diagnosis.result import Accepted, Diagnosis, State
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings
from fish_sysid.diagnosis.symmetry.outcome import beyond, with_findings
from fish_sysid.diagnosis.task import Progress, Task, make_task
from fish_sysid.diagnosis.vocabulary import start_hypothesis
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import EffectTable
from fish_sysid.estimation.refit import global_fit, refit, refit_on


def diagnose(
    experiment: Experiment,
    robot: Robot,
    level: Level | None = None,
    progress: Progress = lambda _: None,
    names: Sequence[str] | None = None,
    effects: EffectTable = EFFECTS,
    without: Collection[str] = frozenset(),
) -> Diagnosis:
    """Answer for one experiment; `progress` gets a line at every step.

    names: what competes, by default all of `candidates(effects)`; effects: by name, with those of one's own; without: stages of
    `task.STAGES` that are switched off. Raises ValueError for an unknown name or stage, NoCandidateError if no name can be
    judged.
    """
    task = make_task(experiment, robot, level, progress, names, effects, without)
    task.progress("testing symmetries")
    symmetry = symmetry_findings(task.experiment, task.robot)
    task.progress("can the model follow the fish?")
    misses = missed_by(task)
    task.progress("fitting the nominal model")
    nominal = fit_nominal(task)
    state = searched(nominal, task) if misses is None else unsearched(nominal, task)
    found = replace(conclude(state, task), symmetry=symmetry, misses=misses)
    found = replace(found, settled=with_symmetry_found(found, of_training(symmetry, task)))
    return by_predictions(with_surrogate(found))


def searched(nominal: Fit, task: Task) -> State:
    """The effects that the likelihood asks for."""
    selection = select_effects(nominal, task)
    state = on_training(selection, task)
    if task.runs("model order"):
        finer = task.kept("model order", None, better_order(selection, state.law, task))
        state = state if finer is None else on_training(select_effects(finer, task), task)
    if task.runs("backward elimination") and len(state.accepted) > 1:
        final, accepted = eliminate(state.final, state.accepted, task)
        state = task.kept("backward elimination", state, with_final(state, final, accepted, task))
    return state


def unsearched(nominal: Fit, task: Task) -> State:
    """The nominal model alone, and the law that it leaves."""
    fit = refit_on(nominal, task.trials.training)
    return State((), (), fit, fit, residual_law(fit, task.trials.training))


def of_training(symmetry: Sequence[SymmetryFinding], task: Task) -> list[SymmetryFinding]:
    """What all trials show, in the numbers of the training trials where these show it too: held-out trials score the model."""
    trained = symmetry_findings(task.trials.training, task.robot)
    own = {f.name: f for f in trained if f.status == "found"}
    return [own.get(f.name, f) if f.status == "found" else f for f in symmetry]


def with_symmetry_found(d: Diagnosis, symmetry: Sequence[SymmetryFinding]) -> Fit | None:
    """The model of the search, refitted with what symmetry tests find and no fit has; None without any."""
    base = of_search(d)
    lacking = beyond(base.hypothesis.names, symmetry)
    robot = with_findings(base.hypothesis.robot, lacking)
    if robot == base.hypothesis.robot:
        return None
    d.task.progress("refitting with what the symmetries show")
    training = d.task.trials.training
    hypothesis = replace(base.hypothesis, robot=robot)
    return refit_on(evaluate(hypothesis, base.theta, training, base.noise), training)


def fit_nominal(task: Task) -> Fit:
    """The model as given, fitted globally on the start of every searched trial, then on the whole."""
    short = task.trials.short
    noise = usual_noise(short)
    fit = global_fit(start_hypothesis(task.robot, short, noise), short, noise)
    return refit(fit.hypothesis, fit.theta, task.trials.searched, fit.noise)


def on_training(selection: Selection, task: Task) -> State:
    """The nominal and the selected model on all training trials, and the law that the latter leaves."""
    task.progress("fitting all training trials")
    training = task.trials.training
    nominal, final = selection.rounds[0].base, selection.base
    same = nominal.hypothesis.names == final.hypothesis.names  # the last base is the better optimum
    fits = on_all_cores(lambda fit: refit_on(fit, training), [final] if same else [nominal, final])
    law = residual_law(fits[-1], training)
    return State(selection.rounds, selection.accepted, fits[0], fits[-1], law)


def with_final(state: State, final: Fit, accepted: tuple[Accepted, ...], task: Task) -> State:
    """The state with another final fit and the law that it leaves; the same state where nothing is another one."""
    if final is not state.final:
        law = residual_law(final, task.trials.training)
        return replace(state, final=final, accepted=accepted, law=law)
    same = all(map(operator.is_, accepted, state.accepted))
    return state if same else replace(state, accepted=accepted)
