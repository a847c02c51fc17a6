# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a name in NEW, refitted at its strength: the simulation is linearised where they are, not at zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.candidates import MEAN_FLOW, PROBES, SIMULATED, typical
from fish_sysid.diagnosis.change.channels import Swim
from fish_sysid.diagnosis.change.naming import Judged
from fish_sysid.diagnosis.change.rows import TrialRows
from fish_sysid.diagnosis.change.shared_fit import CHANGE, Regression, by_old_trials, scaled_rows
from fish_sysid.diagnosis.change.simulation import Variant, simulate
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.place import MEAN, TERMS
from fish_sysid.diagnosis.symmetry.regression import jackknife
from fish_sysid.estimation.parametrization import effect_class, scale_of

Array = NDArray[np.float64]

ROUNDS = 3  # of linearisation
WEAKEST = 0.25  # of the typical strength that is named
STEP = 0.1  # of a typical strength, for differences
# parameters, besides the strengths, that the data determine
PLACED = {"payload": ("mass", "forward", "left")}
LIMITS = ("rudder_saturation", "rotor_saturation")  # act by being small


@dataclass(frozen=True)
class Refitted:
    """Values of a name's parameters."""

    parameters: dict[str, Estimate]
    refused: str  # why these values are no such effect, or too little of it; "": they are one
    by_trial: Array  # (M,) nats on each of NEW's trials, left out


def refit(
    fit: Regression,
    new: Sequence[TrialRows],
    robot: Robot,
    experiment: Experiment,
    days: Sequence[Swim],
    judged: Judged,
) -> Refitted:
    """The parameters of a candidate in NEW alone, other candidates being what OLD has.

    Written-down candidates are linear. Simulated ones are linearised again where they are, ROUNDS times.
    """
    name = judged.name
    if name not in SIMULATED or by_old_trials(judged.key):
        return refitted(name, *_linear(judged), judged.by_trial)
    keys = PLACED.get(name, effect_class(name).strength)
    unit = np.array([scale_of(effect_class(name).parameters[k]) for k in keys])
    values, left_out, gains = _start(name, keys), np.zeros((0, len(keys))), judged.by_trial
    for _ in range(ROUNDS):
        moved, columns = _linearised(robot, experiment, days, name, keys, values, unit)
        stepper = _Step(fit, new, moved, columns)
        offset = (values - _neutral(name, keys)) / unit
        step = np.clip(stepper.solved(None, offset)[0], -1.0, 1.0)
        found = [stepper.solved(m, offset) for m in range(len(new))]
        left_out = np.array([values + unit * d for d, _ in found])
        gains = np.array([stepper.gain(m, *one) for m, one in enumerate(found)]) / judged.dispersion
        values = _clipped(name, keys, values + unit * step)
    std = np.sqrt(fit.of_difference) * jackknife(left_out)
    return refitted(name, dict(zip(keys, values.tolist(), strict=True)),
                     dict(zip(keys, std.tolist(), strict=True)), gains)  # fmt: skip


def _linear(judged: Judged) -> tuple[dict[str, float], dict[str, float]]:
    """Values and standard errors of a candidate that is written down; none of one whose columns are no parameters."""
    name, size = judged.name, np.sqrt(np.diag(judged.covariance))
    keys = _KEYS.get(name)
    if keys is None:
        effect = effect_class(name)
        keys = effect.strength if len(effect.strength) == len(judged.strengths) else ()
    values, errors = {}, {}
    for key, strength, error in zip(keys, judged.strengths, size, strict=False):
        neutral = effect_class(name).parameters[key].value
        unit = MEAN_FLOW if key in MEAN else typical(name, key) - neutral
        values[key], errors[key] = neutral + strength * unit, abs(unit) * error
    return values, errors


_KEYS: dict[str, tuple[str, ...]] = {
    "nonuniform_current": (*MEAN, *TERMS),
    "wall_effect": (),
    "tether": (),
    "sloshing": (),
}


def _start(name: str, keys: Sequence[str]) -> Array:
    """Values from which a simulated effect is fitted: a little of it, a limit where the typical one is."""
    at = PROBES[name][-1] if name in PROBES else {}
    return np.array(
        [
            at.get(k, _neutral(name, [k])[0] + 0.3 * (typical(name, k) - _neutral(name, [k])[0]))
            for k in keys
        ]
    )


def _neutral(name: str, keys: Sequence[str]) -> Array:
    return np.array([effect_class(name).parameters[k].value for k in keys])


def _linearised(
    robot: Robot,
    experiment: Experiment,
    days: Sequence[Swim],
    name: str,
    keys: Sequence[str],
    values: Array,
    unit: Array,
) -> tuple[list[Array], list[Array]]:
    """What the values change (N,), and the slopes (N, K) per typical strength, in each trial."""
    rest = {k: p.value for k, p in effect_class(name).parameters.items()}
    at = {**rest, **dict(zip(keys, values.tolist(), strict=True))}
    steps = np.where(values + STEP * unit > _highest(name, keys), -STEP, STEP)
    variants = [Variant("", {}), Variant(name, at)]
    variants += [
        Variant(name, {**at, k: at[k] + float(s * u)})
        for k, s, u in zip(keys, steps, unit, strict=True)
    ]
    own, there, *moved = simulate(robot, experiment, days, variants)
    change = [np.nan_to_num(s.flat(b - a)) for s, a, b in zip(days, own, there, strict=True)]
    slopes = [
        np.nan_to_num(
            np.column_stack(
                [s.flat((m[i] - there[i]) / step) for m, step in zip(moved, steps, strict=True)]
            )
        )
        for i, s in enumerate(days)
    ]
    return change, slopes


class _Step:
    """Gauss-Newton steps of an effect's parameters in NEW, with what OLD and NEW share free."""

    def __init__(
        self,
        fit: Regression,
        new: Sequence[TrialRows],
        moved: Sequence[Array],
        columns: Sequence[Array],
    ) -> None:
        self._fit = fit
        self._parts = []  # of each trial: shared columns, slopes, measured less what the values change, measured
        for trial, (x, y, w), change, slope in zip(new, fit.rows, moved, columns, strict=True):
            kept = slice(None) if trial.kept is None else trial.kept
            both = np.where(trial.valid[:, None], np.column_stack([change, slope])[kept], 0.0)
            z = scaled_rows(trial, both, fit.noise)[0] * w[:, None]
            self._parts.append((x, z[:, 1:], y - z[:, 0], y))
        self._G = fit.gram[:, : fit.shared, : fit.shared].sum(axis=0) + np.diag(fit.precision)
        self._h = fit.moment[: fit.old, : fit.shared].sum(axis=0)

    def solved(self, without: int | None, offset: Array) -> tuple[Array, Array]:
        """(step (K,), shared coefficients (S,)), without a trial; offset (K,): how far the values are from neutral."""
        used = [part for i, part in enumerate(self._parts) if i != without]
        G, S = self._G, self._fit.shared
        if without is not None:
            G = G - self._fit.gram[self._fit.old + without][:S, :S]
        X, Z, y = (np.concatenate([part[i] for part in used]) for i in range(3))
        prior = np.eye(Z.shape[1]) / CHANGE**2
        normal = np.block([[G, X.T @ Z], [Z.T @ X, Z.T @ Z + prior]])
        b = np.linalg.solve(normal, np.concatenate([self._h + X.T @ y, Z.T @ y - prior @ offset]))
        return b[S:], b[:S]

    def gain(self, m: int, step: Array, shared: Array) -> float:
        """Nats on trial m, left out, of a step (K,) and shared coefficients (S,): against the shared columns alone."""
        fit, S = self._fit, self._fit.shared
        X, Z, y, measured = self._parts[m]
        at = fit.old + m
        alone = np.linalg.solve(
            self._G - fit.gram[at][:S, :S], fit.moment[:, :S].sum(axis=0) - fit.moment[at][:S]
        )
        rest, with_it = measured - X @ alone, y - X @ shared - Z @ step
        return 0.5 * float(rest @ rest - with_it @ with_it)


def _highest(name: str, keys: Sequence[str]) -> Array:
    return np.array([effect_class(name).parameters[k].highest for k in keys])


def _clipped(name: str, keys: Sequence[str], values: Array) -> Array:
    lowest = [effect_class(name).parameters[k].lowest for k in keys]
    return np.clip(values, lowest, _highest(name, keys))


def refitted(
    name: str, values: dict[str, float], errors: dict[str, float], by_trial: Array
) -> Refitted:
    """Values of a name with their standard errors, nats by trial (M,), and whether they are such an effect."""
    effect = effect_class(name)
    found = {k: Estimate(v, errors[k], effect.parameters[k].unit) for k, v in values.items()}
    return Refitted(found, degenerate(name, values) or _too_weak(name, values), by_trial)


def _too_weak(name: str, values: dict[str, float]) -> str:
    """Why a name is not said of so little of it; "" where one strength is WEAKEST of its typical one, or not known."""
    if name in LIMITS:
        return ""
    effect = effect_class(name)
    known = {k: values[k] for k in effect.strength if k in values}
    sizes = [
        abs((v - effect.parameters[k].value) / (typical(name, k) - effect.parameters[k].value))
        for k, v in known.items()
    ]
    if not sizes or max(sizes) >= WEAKEST:
        return ""
    said = ", ".join(f"{k} {v:.2g} {effect.parameters[k].unit}" for k, v in known.items())
    return f"{name}: {said} is too little of it to be told from what the model lacks"
