# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which names of the vocabulary a program of swims can tell apart, by the signals that they leave in the filter's innovations.

Of an effect i, s_i: change of the whitened innovations where the robot has it at its typical strength and the model does not. The
model's parameters, whose signals are the columns of J, take what they can of it:

    S = C' C - C' J (J' J + P^-2)^-1 J' C,   C = [s_1 .. s_E]

S_ii / 2: nats that the model with i gains over the refitted one without it. An effect j that stands in for i takes the share
S_ij (S_jj + 1 / prior^2)^-1 S_ji / S_ii of them; where it has several strengths, S_ij and S_jj are blocks. All is linear in the
strengths: far from small ones, and for parameters that are no strength (a place, a frequency), the answer is an approximation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sysid.design.sensitivity import (
    SensorSet,
    Swims,
    innovations,
    shown,
    signals_of_parameters,
)
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.vocabulary import NOT_A_NAME
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import (
    EFFECT_PRIOR,
    NOMINAL_FREE,
    AnyEffect,
    effect_class,
    nominal_hypothesis,
    start_values,
)
from fish_sysid.estimation.thresholds import PLAUSIBLE, TEMPER

Array = NDArray[np.float64]
Report = Callable[[str], None]

PARTS = (0.01, 0.1, 0.3, 1.0)  # of the typical strength
PROPORTIONAL = 0.5  # of the signal at typical strength, that a part of it must have in proportion
SILENT = 1e-6  # square of a signal of nothing but rounding


@dataclass(frozen=True)
class Detectability:
    """Of E effects in given swims."""

    names: tuple[str, ...]
    gain: Array  # (E,) nats at typical strength
    absorbed: Array  # (E,) share of the signal's square that the parameters take
    needed: Array  # (E,) nats that a diagnosis asks for
    alike: Array  # (E, E) share of i's gain that j takes in its place

    @property
    def strength(self) -> Array:
        """(E,) multiple of the typical strength from which a diagnosis can see it; inf: not at any."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(self.needed / self.gain))

    @property
    def telling(self) -> Array:
        """(E, E) multiple of i's typical strength from which j is no rival of it any more; inf: at none."""
        left = self.gain[:, None] * (1.0 - np.minimum(self.alike, 1.0))
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(-TEMPER * np.log(PLAUSIBLE) / left))


def vocabulary(robot: Robot, names: Sequence[str] = ()) -> tuple[str, ...]:
    """These names, or all that the robot does not have; raises ValueError for an unknown one."""
    known = [name for name in (*robot.table, *SENSOR_EFFECTS) if name not in NOT_A_NAME]
    for name in names:
        if name not in known:
            raise ValueError(f"unknown name {name!r}; known: {', '.join(known)}")
    own = (*robot.effects, *robot.sensors)
    return tuple(names) or tuple(name for name in known if name not in own)


def detectability(
    robot: Robot,
    swims: Swims,
    names: Sequence[str],
    sensors: SensorSet | None = None,
    noise: Noise | None = None,
    free: tuple[str, ...] = NOMINAL_FREE,
    report: Report = lambda _: None,
) -> Detectability:
    """Of these names, in swims of a robot that has none of them."""
    sensors, noise = sensors or SensorSet(), noise or Noise()
    hypothesis = nominal_hypothesis(robot, free)
    own = shown(robot, swims, sensors)
    base = innovations(hypothesis, own, noise)
    report("the model's parameters")
    J = signals_of_parameters(hypothesis, swims, sensors, noise, base)

    def signal(name: str, values: dict[str, float]) -> Array:
        recorded = shown(robot.with_effect(name, **values), swims, sensors)
        return innovations(hypothesis, recorded, noise) - base

    columns: list[Array] = []
    groups: list[range] = []
    for name in names:
        report(name)
        found = _signals(effect_class(name, robot.table), partial(signal, name), swims)
        groups.append(range(len(columns), len(columns) + len(found)))
        columns += found
    C = np.array(columns).T
    normal = J.T @ J + np.diag(1.0 / hypothesis.parametrization.prior**2)
    raw, across = C.T @ C, J.T @ C
    S = raw - across.T @ np.linalg.solve(normal, across)
    sampled = (own.gyro, own.accel, own.encoder, *(f.pose for f in own.frames))
    samples = float(sum(np.isfinite(values).sum() for values in sampled))
    counts = [len(effect_class(name, robot.table).parameters) for name in names]
    needed = np.array([Level().needed(samples, count, len(names)) for count in counts])
    first = [group[0] for group in groups]
    square, left = np.diag(raw)[first], np.maximum(np.diag(S)[first], 0.0)
    absorbed = np.where(square > SILENT, 1.0 - left / np.maximum(square, SILENT), 0.0)
    gain = np.where(square > SILENT, left / 2.0, 0.0)
    return Detectability(tuple(names), gain, absorbed, needed, _alike(S, groups))


def _signals(
    effect: AnyEffect, signal: Callable[[dict[str, float]], Array], swims: Swims
) -> list[Array]:
    """Signals (R,) at typical strength: of all strengths together, then of each where there are several.

    They are those of a small part of it, times its inverse, where the signal grows in proportion; a lag far below a step of
    10 ms, or a limit that nothing reaches, leaves none.
    """
    neutral = _neutral(effect, swims)

    def at(part: float) -> dict[str, float]:
        typical = start_values(effect, 1.0)
        return typical | {k: v + part * (typical[k] - v) for k, v in neutral.items()}

    full = np.linalg.norm(signal(at(1.0)))
    for part in PARTS:
        whole = signal(at(part)) / part
        if np.linalg.norm(whole) >= PROPORTIONAL * full:
            break
    several = effect.strength if len(effect.strength) > 1 else ()
    single = [at(part) | {k: v for k, v in neutral.items() if k != kept} for kept in several]
    return [whole, *(signal(values) / part for values in single)]


def _neutral(effect: AnyEffect, swims: Swims) -> dict[str, float]:
    """Values of the strengths at which the effect begins: a limit begins at the largest command."""
    largest = np.abs(swims.commands).max(axis=(0, 1))
    command = {"rotor_saturation": largest[0], "rudder_saturation": largest[1]}.get(effect.name)
    values = {key: effect.parameters[key].value for key in effect.strength}
    return values if command is None else {k: min(v, float(command)) for k, v in values.items()}


def _alike(S: Array, groups: Sequence[range]) -> Array:
    """(E, E) share of i's gain that j takes in its place; row and column groups of S: whole signal, then single strengths."""
    first = [group[0] for group in groups]
    signal = np.diag(S)[first]
    alike = np.zeros((len(groups), len(groups)))
    for j, group in enumerate(groups):
        own = list(group[1:]) or list(group)
        block = S[np.ix_(own, own)] + np.eye(len(own)) / EFFECT_PRIOR**2
        across = S[np.ix_(first, own)]
        taken = np.einsum("ip,pi->i", across, np.linalg.solve(block, across.T))
        alike[:, j] = np.where(signal > SILENT, taken / np.maximum(signal, SILENT), 0.0)
    return np.clip(alike, 0.0, 1.0)
