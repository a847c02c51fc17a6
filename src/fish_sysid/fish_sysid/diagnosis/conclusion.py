# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From the final models to the diagnosis: where force is missing, what each effect does, and errors on held-out trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.backward_elimination import without
from fish_sysid.diagnosis.can_follow import missed_with
from fish_sysid.diagnosis.corrected_model import much_is_left, named
from fish_sysid.diagnosis.effect_wrench import effect_wrench, pushes
from fish_sysid.diagnosis.latent_force import MissingForce, missing_force
from fish_sysid.diagnosis.result import Diagnosis, State
from fish_sysid.diagnosis.surrogate_model import STRUCTURAL, surrogate_model
from fish_sysid.diagnosis.task import Task
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, initial_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis


def conclude(state: State, task: Task) -> Diagnosis:
    """The diagnosis by the search alone."""
    training, nominal, final = task.trials.training, state.nominal, state.final
    names = [accepted.name for accepted in state.accepted]
    task.progress("locating the missing force")
    force = missing_force(nominal, training)
    remaining = missing_force(final, training) if names else force
    parts = shares(final, names, training)
    acting = [name for name in names if pushes(final.hypothesis.effect(name))]
    wrenches = {name: effect_wrench(final, name, training) for name in acting}
    task.progress("scoring held-out trials")
    unseen = task.experiment.select(task.split.held_out or task.split.training)
    noise = initial_noise(unseen, task.robot, nominal.noise)
    held = held_out_density(unseen, task.robot, noise, nominal, final)
    return Diagnosis(task, state, force, parts, wrenches, remaining, noise, held)


def with_surrogate(d: Diagnosis) -> Diagnosis:
    """The diagnosis with a surrogate model, where no name fits and much is left."""
    task = d.task
    if named(d) or not much_is_left(d) or not task.runs("surrogate model"):
        return d
    accepted = [a.name for a in d.accepted]
    structural = tuple(dict.fromkeys((*accepted, *(n for n in STRUCTURAL if n in task.names))))
    helpful = structural
    if task.runs("surrogate's own choice"):
        every = tuple(dict.fromkeys((*structural, *task.names)))
        helpful = task.kept("surrogate's own choice", structural, every)
    start = d.settled or d.nominal
    model, asked = surrogate_model(start, helpful, task.trials.training, task.progress)
    return task.kept("surrogate model", d, replace(d, surrogate=model, predicted=asked))


def by_predictions(d: Diagnosis) -> Diagnosis:
    """Where the likelihood names nothing: whether the model follows the fish with what predictions ask for."""
    if d.misses is None or d.surrogate is None or not d.predicted:
        return d
    d.task.progress("can the model follow the fish with these effects?")
    robot = d.surrogate.robot.without_effect("disturbance")
    left = missed_with([asked.step.name for asked in d.predicted], robot, d.task)
    return replace(d, still_misses=left)


def shares(
    final: Fit, names: Sequence[str], training: Experiment
) -> dict[str, tuple[Fit, MissingForce]]:
    """Of several effects each one's part: the model less it, with the noise it then needs, and the force that it lacks."""

    def part(name: str) -> tuple[Fit, MissingForce]:
        less = without(final, name, training)
        return less, missing_force(less, training)

    several = names if len(names) > 1 else []
    return dict(zip(several, on_all_cores(part, several), strict=True))


def held_out_density(
    held: Experiment, robot: Robot, given_noise: Noise, nominal: Fit, final: Fit
) -> dict[str, Array]:
    """Log density (M,) per scalar measurement of each held-out trial: model as given, refitted, with effects."""
    given = evaluate(nominal_hypothesis(robot, ()), np.zeros(0), held, given_noise)
    density = {}
    for name, fit in (("nominal", given), ("refitted", nominal), ("with_effects", final)):
        result = evaluate(fit.hypothesis, fit.theta, held, fit.noise).result
        density[name] = result.log_likelihood / result.samples
    return density
