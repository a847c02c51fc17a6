# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Members of an effect's family that predict trials left out as well as it does, each in its place.

An effect that another one makes superfluous is gone when the search ends, though the recordings may not tell the two apart. So
each effect of the final model is exchanged for every member of its family that was judged, and both fits go on alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.vocabulary import family_of
from fish_sysid.estimation.shooting.left_out import Step, converged, judged, left_out_costs
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.rollout import ShotParametrization
from fish_sysid.estimation.shooting.schedule import Found
from fish_sysid.estimation.shooting.selection import starts, without

Values = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Named:
    """An effect that predictions ask for.

    Attributes:
        step: what it does to trials left out.
        rivals: values of the members of its family that do as well in its place.
    """

    step: Step
    rivals: Values


def with_rivals(experiment: Experiment, found: Found, steps: Sequence[Step]) -> tuple[Named, ...]:
    """The effects that were added, each with its rivals among all that were judged."""
    added = [step for step in steps if step.added]
    taken = {step.name for step in added}  # one may be judged in several rounds before it is added
    others = dict.fromkeys(step.name for step in steps if step.name not in taken)
    pairs = [
        (step, other)
        for step in added
        for other in others
        if family_of(other) and family_of(other) == family_of(step.name)
    ]
    if not pairs:
        return tuple(Named(step, {}) for step in added)
    control, costs = left_out_costs(experiment, found)

    def exchanged(pair: tuple[Step, str]) -> dict[str, float] | None:
        """Values of the other one where it does as well, else None."""
        step, other = pair
        fit, own = converged(experiment, starts(without(control, step.name), other), control.cost)
        loses = judged(other, costs, own)
        return values_of(fit, other) if loses.gain > -loses.deviation else None

    found_values = on_all_cores(exchanged, pairs)
    rivals: dict[str, Values] = {step.name: {} for step in added}
    for (step, other), values in zip(pairs, found_values, strict=True):
        if values is not None:
            rivals[step.name][other] = values
    return tuple(Named(step, rivals[step.name]) for step in added)


def values_of(found: Found, name: str) -> dict[str, float]:
    """Parameters of one effect in a fit."""
    theta = found.z[: -len(SENSORS)]
    return dict(ShotParametrization(found.hypothesis).robot(theta).effects[name])
