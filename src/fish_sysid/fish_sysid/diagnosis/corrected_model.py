# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis comes to: which names stand, whether much is left, which robot to go on with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.prediction_rivals import Named
from fish_sysid.diagnosis.result import Accepted, Diagnosis
from fish_sysid.diagnosis.vocabulary import kind_of
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.shooting.schedule import TOO_FAR
from fish_sysid.estimation.thresholds import MOST_UNEXPLAINED, RATIO_REJECT
from fish_sysid.prediction.prediction import EVERY, WARM_UP, predict, prediction_errors

Array = NDArray[np.float64]

AFTER = (1.0, 5.0)  # s
WORSE = 1.05  # times the refitted nominal model's error; two models as good differ by as much


def verdict(d: Diagnosis) -> str:
    """no_mismatch, missing_physics, sensor_or_actuator or unexplained.

    Where the likelihood cannot be asked, names by prediction decide if the model follows the fish with them. That nothing is
    missing it cannot say there: no name was searched for.
    """
    names = [a.name for a in named(d)]
    if d.still_misses is not None and d.still_misses <= TOO_FAR:
        names = [asked.step.name for asked in asked_by_predictions(d)]
    if not names:
        told = d.misses is not None or much_is_left(d) or refused(d)
        return "unexplained" if told else "no_mismatch"
    kinds = {kind_of(name, d.task.robot.table) for name in names}
    return "missing_physics" if "physics" in kinds else "sensor_or_actuator"


def much_is_left(d: Diagnosis) -> bool:
    """The wrench that remains is far stronger than water, or follows a law on trials that the law has not seen."""
    return d.final.largest_ratio > RATIO_REJECT or bool(d.state.law.lawful(d.task.level))


def named(d: Diagnosis) -> tuple[Accepted, ...]:
    """The accepted effects, or none where they leave more than they take away: nearest is not right."""
    if much_is_left(d) and unexplained_share(d) > MOST_UNEXPLAINED:
        return ()
    return tuple(a for a in d.accepted if not limit_of(d, a.name))


def asked_by_predictions(d: Diagnosis) -> tuple[Named, ...]:
    """Names and rivals that stand by predictions: only where the likelihood cannot be asked."""
    return standing(d) if d.misses is not None else ()


def standing(d: Diagnosis) -> tuple[Named, ...]:
    """What predictions ask for, less the names and rivals whose values are those of another effect, or of none."""
    if d.surrogate is None:
        return ()
    table, found = d.task.robot.table, []
    for asked in d.predicted:
        if not limit_in(d.surrogate, asked.step.name, d.task.robot):
            rivals = {k: v for k, v in asked.rivals.items() if not degenerate(k, v, table)}
            found.append(replace(asked, rivals=rivals))
    return tuple(found)


def refused(d: Diagnosis) -> list[str]:
    """What the accepted effects are that lie in a limit where they are another effect or none."""
    return [text for a in d.accepted if (text := limit_of(d, a.name))]


def limit_of(d: Diagnosis, name: str) -> str:
    """Why the values of an effect in the final model are not this effect; "" where they are."""
    return limit_in(d.final, name, d.task.robot)


def limit_in(fit: Fit, name: str, robot: Robot) -> str:
    """The same of an effect in a fit."""
    first = f"{name}."
    values = {k.removeprefix(first): v for k, v in fit.values.items() if k.startswith(first)}
    return degenerate(name, values, robot.table)


def unexplained_share(d: Diagnosis) -> float:
    """Part of the mismatch that is still there: densities of the wrench beyond those of usual water."""
    final, nominal = d.final.process_noise_ratio, d.nominal.process_noise_ratio
    left, removed = np.sum(np.maximum(final - 1.0, 0.0)), np.sum(np.maximum(nominal - final, 0.0))
    return float(left / (left + removed)) if left + removed > 0 else 0.0


def of_search(d: Diagnosis) -> Fit:
    """The model with the effects that the search names, or the refitted nominal one where that predicts better."""
    if named(d) and not predicts_worse(d.final, d.nominal, d.unseen):
        return d.final
    return d.nominal


def corrected(d: Diagnosis) -> Fit:
    """The fit that model.yaml holds: never one that predicts held-out trials worse than the refitted nominal model.

    It is the one with most in it that predicts none the worse for it: the surrogate, with what symmetry tests find, of the
    search, the refitted nominal one.
    """
    fits = [fit for fit in (d.surrogate, d.settled, of_search(d), d.nominal) if fit is not None]
    for k, fit in enumerate(fits):
        if not any(predicts_worse(fit, less, d.unseen) for less in fits[k + 1 :]):
            break
    return fit


def predicts_worse(fit: Fit, nominal: Fit, unseen: Experiment) -> bool:
    """Whether positions after 1 and 5 s are further off than the nominal model's: their ratio's geometric mean is over WORSE.

    So does one that diverges where the nominal model does not.
    """
    if fit is nominal:
        return False
    mine, its = (position_errors(f, unseen) for f in (fit, nominal))
    known = np.isfinite(its)
    if not known.any():
        return False
    if not np.isfinite(mine[known]).all():
        return True
    return bool(np.mean(np.log(mine[known] / its[known])) > np.log(WORSE))


def position_errors(fit: Fit, unseen: Experiment) -> Array:
    """(2,) rms errors of position [m] at AFTER; NaN where no trial is long enough or all predictions diverge."""
    made = predict(unseen, fit.robot, fit.noise, max(AFTER), EVERY, WARM_UP)
    sizes = prediction_errors(made, AFTER)
    return np.where(sizes.counts.sum(axis=0) > 0, sizes.rms[:, 0], np.nan)
