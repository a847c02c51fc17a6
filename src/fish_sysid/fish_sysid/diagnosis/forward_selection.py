# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Forward selection: add one effect at a time while one is significant and predicts trials that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

from fish_sysid.diagnosis.cross_validation import gain_left_out, gain_unseen, on_all
from fish_sysid.diagnosis.result import Accepted, Round
from fish_sysid.diagnosis.selection_round import run_round
from fish_sysid.diagnosis.significance import (
    Level,
    evidence,
    parameter_count,
    simplest,
    strength_z,
)
from fish_sysid.diagnosis.task import Task, Trials
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.thresholds import (
    FAIR_SHARE,
    MOST_EFFECTS,
    SMALLEST_CHECK,
    SMALLEST_Z,
)


@dataclass(frozen=True)
class Selection:
    """The model that the search came to."""

    base: Fit  # on the searched trials, with the accepted effects
    rounds: tuple[Round, ...]  # the last one found nothing more
    accepted: tuple[Accepted, ...]


def select_effects(base: Fit, task: Task) -> Selection:
    """While a candidate is significant: add it, refit, screen again."""
    selection = Selection(base, (), ())
    while len(selection.accepted) < min(MOST_EFFECTS, len(task.names)):
        found = run_round(selection.base, task)
        rounds = (*selection.rounds, found)
        name = choose(found, task)
        if name is None:  # the round's base may be a better optimum of the same model
            return Selection(found.base, rounds, selection.accepted)
        accepted = (*selection.accepted, Accepted(name, found, found.refitted))
        selection = Selection(found.refitted[name], rounds, accepted)
        task.progress(f"found {name}: {found.gain(name):.0f} nats")
    return selection


def choose(found: Round, task: Task) -> str | None:
    """The name to add: most evidence among the significant ones that the check confirms, the simplest of those as good."""
    tried, trials, level = len(task.needed(found.base)), task.trials, task.level
    good = significant(found, tried, level)
    if not good:
        return None
    base = on_all(found.base, trials.training)
    checked = task.runs("check on unseen trials")
    confirmed = {
        name: found.refitted[name]
        for name in good
        if not checked or predicts_unseen(base, found.refitted[name], trials, tried, level)
    }
    if len(confirmed) < len(good):
        task.acted.add("check on unseen trials")
    if not confirmed:
        return None
    return simplest(max(confirmed, key=lambda name: evidence(confirmed[name])), confirmed, level)


def significant(found: Round, tried: int, level: Level) -> list[str]:
    """Refitted names with enough gain, and a strength that differs from neutral."""
    return [
        name
        for name, fit in found.refitted.items()
        if found.gain(name) > level.needed(found.base.samples, parameter_count(fit, name), tried)
        and strength_z(fit, name) > SMALLEST_Z
    ]


def predicts_unseen(base: Fit, fit: Fit, trials: Trials, tried: int, level: Level) -> bool:
    """Whether a fit predicts trials that it was not fitted to, better than the base on all trials does.

    A fair share of what it would gain on the check if it were true; where the check does not excite the effect, enough on
    every training trial in turn.
    """
    everywhere = on_all(fit, trials.training)
    gain, expected = gain_unseen(base, everywhere, trials.check)
    if expected < SMALLEST_CHECK:
        needed = level.needed_unseen(base.samples, tried)
        return gain_left_out(base, everywhere)[0] > needed
    return gain > max(FAIR_SHARE * expected, SMALLEST_CHECK)
