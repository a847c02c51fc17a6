# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A change of the rudder by the gyro's answer to it: named before any other, or a second opinion on the rudder's timing.

Stroke means take a second together, in which a lag and a delay look the same. OLD's gyro is regressed on the past of the rudder
and of the rotor's commands: a finite impulse response on a grid of 20 ms. NEW's commands go through a servo before they go into
OLD's response. Which servo predicts NEW's gyro best, its number found on NEW's other trials, is judged trial by trial. No model
of the fish takes part. The p-value is NEW's rank among sets of trials in its place, as in `permutation_test`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.comparable import FEWEST_NEW, FEWEST_OLD
from fish_sysid.diagnosis.change.naming import apart, tie
from fish_sysid.diagnosis.change.permutation_test import SETS, p_value_of
from fish_sysid.diagnosis.change.servos import ANSWERED, SERVOS, lagged
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.change.swap_test import Index
from fish_sysid.diagnosis.degenerate import degenerate
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.regression import jackknife

Array = NDArray[np.float64]


STEP, MEMORY = 2, 30  # least grid points between samples, samples of past: 0.6 s
RIDGE = 1e-3  # of the columns' mean square
WARM_UP = 1.5  # s, after which the start is forgotten
SMOOTH = 0.5  # s, over which the rotor's power is taken


@dataclass(frozen=True)
class Answered:
    """What one servo explains of NEW."""

    name: str
    gains: Array  # (M,) log of mean square misfit without over that with it, each trial left out
    estimate: Estimate

    @property
    def parameters(self) -> dict[str, Estimate]:
        return {SERVOS[self.name].parameter: self.estimate}


@dataclass(frozen=True)
class StepResponse:
    """The test's answer, the best servo first."""

    p_value: float
    servos: tuple[Answered, ...]


def step_response(
    old: Experiment,
    new: Experiment,
    strata: Sequence[int],
    count: int = SETS,
    days: Sequence[int] = (),
) -> StepResponse | None:
    """The answer by the trials whose gyro says enough; None where OLD or NEW has too few of them.

    strata (M,): OLD's trials first, then NEW's; days (M,): of several days of OLD the number of each trial's day.
    """
    parts = [_Trial.of(e, m) for e in (old, new) for m in range(len(e.names))]
    found = {i: part for i, part in enumerate(parts) if part is not None}
    first = sum(i < len(old.names) for i in found)
    if first < FEWEST_OLD or len(found) - first < FEWEST_NEW:
        return None
    trials, strata = list(found.values()), [strata[i] for i in found]
    days = [days[i] for i in found] if days else ()
    rows = np.arange(first, len(trials))
    observed = _judged(trials, rows)
    pooled = _Pooled.of(trials)
    p = p_value_of(pooled.gain, strata, rows, days, count)
    answers = [
        Answered(name, gains, _estimate(name, losses)) for name, (gains, losses) in observed.items()
    ]
    return StepResponse(p, tuple(sorted(answers, key=lambda a: -a.gains.mean())))


@dataclass(frozen=True)
class _Trial:
    """Normal equations of one trial with the command as it is and through every servo."""

    gram: NDArray[np.float32]  # (S, P, P)
    moment: Array  # (S, P)
    square: float
    count: int

    @classmethod
    def of(cls, experiment: Experiment, m: int) -> _Trial | None:
        steps = int(experiment.steps[m])
        rotor, rudder = experiment.commands[:steps, m].T
        gyro = experiment.gyro[:steps, m]
        at = np.arange(max(round(WARM_UP / DT), STEP * MEMORY), steps)
        at = _spaced(at[np.isfinite(gyro[at])])
        if len(at) < 2 * MEMORY:
            return None
        power = np.sqrt(lagged(rotor**2, SMOOTH))
        y = gyro[at] - gyro[at].mean()
        passed = [rudder, *(s.act(rudder, v) for s in ANSWERED.values() for v in s.tried.tolist())]
        grams, moments = [], []
        for command in passed:
            X = _past((command * power, rotor, np.gradient(command, DT)), at)
            grams.append((X.T @ X).astype(np.float32))
            moments.append(X.T @ y)
        return cls(np.array(grams), np.array(moments), float(y @ y), len(y))

    def losses(self, response: Array) -> Array:
        """(S,) mean square misfit of the gyro by this response (P,)."""
        known = np.einsum("spq,q->sp", self.gram, response) @ response
        misfit = self.square - 2.0 * self.moment @ response + known
        return np.asarray(np.maximum(misfit, 1e-9) / self.count)


@dataclass(frozen=True)
class _Pooled:
    """All trials with one response, each trial's gyro of unit mean square."""

    plain: tuple[Array, Array]  # (P, P), (P,) with the commands as they are
    gram: NDArray[np.float32]  # (M, S, P, P) with a servo less without it
    moment: Array  # (M, S, P)

    @classmethod
    def of(cls, trials: Sequence[_Trial]) -> _Pooled:
        gram = np.array([t.gram / np.float32(t.square) for t in trials])
        moment = np.array([t.moment / t.square for t in trials])
        plain = gram[:, 0].sum(axis=0, dtype=np.float64), moment[:, 0].sum(axis=0)
        return cls(plain, gram - gram[:, :1], moment - moment[:, :1])

    def gain(self, rows: Index) -> float:
        """What the best servo in the trials `rows`, and none in the others, explains of the gyro over what is left then.

        A trial that is changed and counts as unchanged, or the other way round, makes it smaller.
        """
        G = self.plain[0] + self.gram[rows].sum(axis=0, dtype=np.float64)
        h = self.plain[1] + self.moment[rows].sum(axis=0)
        ridge = RIDGE * np.maximum(np.diagonal(G, axis1=1, axis2=2), 1e-9)
        b = np.linalg.solve(G + ridge[:, :, None] * np.eye(G.shape[1]), h[..., None])[..., 0]
        left = len(self.gram) - 2.0 * np.sum(b * h, axis=1) + np.einsum("sp,spq,sq->s", b, G, b)
        return float((left[0] - left.min()) / left.min())


def _spaced(at: Index) -> Index:
    """Of grid points (N,) in their order the first, and each that is STEP or more beyond the one before."""
    kept: list[int] = []
    for k in at.tolist():
        if not kept or k >= kept[-1] + STEP:
            kept.append(k)
    return np.array(kept, dtype=np.int64)


def _past(signals: Sequence[Array], at: NDArray[np.int64]) -> Array:
    """(N, 3 MEMORY) of the signals before `at`, less their means."""
    X = np.hstack([signal[at[:, None] - STEP * np.arange(MEMORY)] for signal in signals])
    return np.asarray(X - X.mean(axis=0))


def _judged(trials: Sequence[_Trial], rows: Index) -> dict[str, tuple[Array, Array]]:
    """Of each servo the gains (M,) on `rows` by the response of all other trials, and log losses (M, 1 + V), without it first."""
    others = [t for i, t in enumerate(trials) if i not in set(rows.tolist())]
    G = sum(t.gram[0].astype(np.float64) for t in others)
    h = sum(t.moment[0] for t in others)
    response = np.linalg.solve(G + RIDGE * np.diag(np.maximum(np.diag(G), 1e-9)), h)
    losses = np.log([trials[i].losses(response) for i in rows])
    found, first = {}, 1
    for name, servo in ANSWERED.items():
        own = np.hstack([losses[:, :1], losses[:, first : first + len(servo.tried)]])
        first += len(servo.tried)
        best = [int((own.sum(axis=0) - row).argmin()) for row in own]
        gains = np.array([row[0] - row[b] for row, b in zip(own, best, strict=True)])
        found[name] = gains, own
    return found


def _estimate(name: str, losses: Array) -> Estimate:
    """The number that suits all trials best, between those tried by a parabola, with its jackknife error.

    At an end of those tried there is no parabola: it is known no better than to the last step between them.
    """
    servo, total = SERVOS[name], losses[:, 1:].sum(axis=0)
    left_out = [_lowest(servo.tried, total - row) for row in losses[:, 1:]]
    std = float(jackknife(np.array(left_out)[:, None])[0])
    if (k := int(total.argmin())) in (0, len(total) - 1):
        step = abs(float(servo.tried[k] - servo.tried[1 if k == 0 else k - 1]))
        std = max(std, step / np.sqrt(12.0))  # of a uniform distribution
    return Estimate(_lowest(servo.tried, total), std, servo.unit)


def _lowest(x: Array, y: Array) -> float:
    """Where a parabola through the smallest of (V,) and its neighbours is lowest."""
    k = int(y.argmin())
    if not 0 < k < len(x) - 1:
        return float(x[k])
    a, b, _ = np.polyfit(x[k - 1 : k + 2] - x[k], y[k - 1 : k + 2], 2)
    return float(x[k] + np.clip(-0.5 * b / max(a, 1e-12), x[k - 1] - x[k], x[k + 1] - x[k]))


SECOND_LEVEL = 0.1  # p-value up to which the gyro's answer helps to name what another look has seen


@dataclass(frozen=True)
class RudderChange:
    """What the test says, with its p-value by sets of trials in NEW's place."""

    p_value: float
    named: Named


def rudder_change(
    old: Experiment, new: Experiment, strata: Sequence[int], days: Sequence[int] = ()
) -> RudderChange | None:
    """The servo that NEW's gyro asks for, and those that do about as well; None where no servo does better than none."""
    answer = step_response(old, new, strata, days=days)
    if answer is None:
        return None
    real = [
        s
        for s in answer.servos
        if not degenerate(s.name, {k: e.value for k, e in s.parameters.items()})
    ]
    if not real or real[0].gains.mean() <= 0.0:
        return None
    alike = [s for s in real if not apart(real[0].gains, s.gains)]
    weights = [tie(real[0].gains, s.gains) for s in alike]
    members = tuple(
        Member(s.name, weight / sum(weights), np.nan, Refitted(s.parameters, "", s.gains))
        for s, weight in zip(alike, weights, strict=True)
    )
    return RudderChange(answer.p_value, Named.of(members))


def with_second_opinion(named: Sequence[Named], servo: RudderChange | None) -> list[Named]:
    """The changes, those of the rudder's timing by the means of their probabilities and of those by the gyro's answer.

    The answer has no say where exchanged trials do as well more often than in SECOND_LEVEL.
    """
    if servo is None or servo.p_value > SECOND_LEVEL:
        return list(named)
    return [_both(one, servo.named) if one.family == servo.named.family else one for one in named]


def _both(by_motion: Named, by_gyro: Named) -> Named:
    """One change with the members of both and the gain of the best; where both have one, its numbers are those by the gyro."""
    found: dict[str, Member] = {}
    for member in (*by_gyro.members, *by_motion.members):
        had = found.get(member.name, replace(member, probability=0.0))
        share = 0.5 * member.probability + had.probability
        found[member.name] = replace(had, probability=share)
    members = sorted(found.values(), key=lambda m: -m.probability)
    return Named.of(tuple(members))
