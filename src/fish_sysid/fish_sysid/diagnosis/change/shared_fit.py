# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What OLD and NEW share: a ridge regression on both, with its ridge and noise chosen on OLD's left-out trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.change.candidates import PARAMETER, POOL_AND_SENSORS, SIMULATED
from fish_sysid.diagnosis.change.channels import CHANNELS
from fish_sysid.diagnosis.change.rows import FIRST_NOISE, GYRO_BIAS, TrialRows
from fish_sysid.estimation.shooting.least_squares import huber, weight

Array = NDArray[np.float64]
Key = tuple[str, int]

# what is tried: precision of black-box columns, deviations of bodies and of pool and sensors in typical strengths
RIDGES = tuple(product((1e-3, 1e-2, 1e-1), (0.1, 0.3, 1.0, 3.0), (1e-3, 0.1)))
NOISE_ROUNDS = 2
SMALLEST_SCALE = 0.3  # of the robust spread
CHANGE = 10.0  # deviation of a candidate's strength in NEW, in typical ones
GYRO = (2, 3)  # channels with the gyro's bias


def by_old_trials(key: Key) -> bool:
    """Whether a candidate is a form of `other_commands`, which the black box has anyhow."""
    return key[0] in SIMULATED and key[1] > 0


@dataclass(frozen=True)
class Regression:
    """Normal equations of every trial, in units of noise.

    Columns: shared ones first, then each candidate's own copies, that only NEW's trials count.
    """

    names: tuple[str, ...]  # of the trials, OLD first
    old: int  # how many are OLD's
    gram: Array  # (M, P, P)
    moment: Array  # (M, P)
    square: Array  # (M,) weighted sum of squares
    precision: Array  # (S,) prior of the shared columns
    at: dict[Key, NDArray[np.int64]]  # of a candidate's columns
    noise: Array  # (CHANNELS,)
    rest: Array  # (M,) mean square of what the shared columns leave, in units of noise
    # of NEW's trials: shared columns (N, S), measured, weights, all scaled
    rows: tuple[tuple[Array, Array, Array], ...]

    @property
    def shared(self) -> int:
        return len(self.precision)

    @property
    def of_difference(self) -> float:
        """Variance of NEW less OLD over that of NEW's mean, which the jackknife over NEW's trials gives."""
        return 1.0 + (len(self.names) - self.old) / self.old


@dataclass(frozen=True)
class Settled:
    """What OLD alone settles."""

    noise: Array  # (CHANNELS,)
    precision: Array  # (P,) of all columns, infinite where one is not shared


def _places(trial: TrialRows) -> tuple[dict[Key, NDArray[np.int64]], int]:
    """(columns of each candidate after those of the black box, number of all columns)."""
    at, end = {}, trial.black_box.shape[1]
    for key, columns in trial.candidates.items():
        at[key] = np.arange(end, end + columns.shape[1])
        end += columns.shape[1]
    return at, end


def settled(old: Sequence[TrialRows]) -> Settled:
    """Noise of the channels and the ridge, by leaving OLD's trials out."""
    at, count = _places(old[0])
    keys = list(at)
    shared_keys = [k for k in keys if k[0] != PARAMETER + "all drags" and not by_old_trials(k)]
    columns = [np.hstack([t.black_box, *(t.candidates[k] for k in keys)]) for t in old]
    noise = FIRST_NOISE
    groups = _groups(old[0].black_box.shape[1], count, at, shared_keys)
    for _ in range(NOISE_ROUNDS):
        scaled = [scaled_rows(t, x, noise) for t, x in zip(old, columns, strict=True)]
        precision, residuals = _ridge(scaled, groups)
        noise = noise * _spreads(old, residuals)
    return Settled(noise, precision)


def regression(
    old: Sequence[TrialRows], new: Sequence[TrialRows], by_old: Settled | None = None
) -> Regression:
    """The normal equations with noise and ridge from OLD; by_old: these, where they are known."""
    trials = [*old, *new]
    at, _ = _places(trials[0])
    keys = list(at)
    columns = [np.hstack([t.black_box, *(t.candidates[k] for k in keys)]) for t in trials]
    by_old = settled(old) if by_old is None else by_old
    noise, precision = by_old.noise, by_old.precision
    scaled = [scaled_rows(t, x, noise) for t, x in zip(trials, columns, strict=True)]
    order = np.flatnonzero(np.isfinite(precision))
    weights, rest = _robust(scaled, order, precision[order])
    normal = [_normal(x * w[:, None], y * w) for (x, y), w in zip(scaled, weights, strict=True)]
    G, h = (np.array([n[i] for n in normal]) for i in (0, 1))
    own = np.concatenate([at[k] for k in keys])
    perm = np.concatenate([order, own])
    place = {int(p): len(order) + i for i, p in enumerate(own)}
    return Regression(
        tuple(t.name for t in trials), len(old), G[:, perm][:, :, perm], h[:, perm],
        np.array([np.sum((y * w) ** 2) for (_, y), w in zip(scaled, weights, strict=True)]),
        precision[order], {k: np.array([place[int(i)] for i in idx]) for k, idx in at.items()}, noise, rest,
        tuple((x[:, order] * w[:, None], y * w, w) for (x, y), w in zip(scaled[len(old) :], weights[len(old) :], strict=True)),
    )  # fmt: skip


def _groups(box: int, P: int, at: dict[Key, NDArray[np.int64]], shared: Sequence[Key]) -> Array:
    """(P,) 0 black box, 1 body, 2 pool and sensors, 3 not shared."""
    group = np.full(P, 3)
    group[:box] = 0
    for k in shared:
        group[at[k]] = 2 if k[0] in POOL_AND_SENSORS else 1
    return group


def scaled_rows(trial: TrialRows, columns: Array, noise: Array) -> tuple[Array, Array]:
    """Columns and measurements in units of noise (CHANNELS,), whitened for the gyro's bias in the trial."""
    size = 1.0 / noise[trial.channel]
    sign = np.where(trial.channel == GYRO[0], 1.0, np.where(trial.channel == GYRO[1], -1.0, 0.0))
    bias = np.where(trial.valid, GYRO_BIAS * sign * size, 0.0)
    x, y, square = columns * size[:, None], trial.measured * size, float(bias @ bias)
    # (I + b b')^-1/2 = I - (1 - 1 / sqrt(1 + b'b)) b b' / b'b
    shrunk = bias * (1.0 - 1.0 / np.sqrt(1.0 + square)) / max(square, 1e-12)
    return x - np.outer(shrunk, bias @ x), y - shrunk * (bias @ y)


def _normal(x: Array, y: Array) -> tuple[Array, Array]:
    return x.T @ x, x.T @ y


def _ridge(scaled: Sequence[tuple[Array, Array]], groups: Array) -> tuple[Array, list[Array]]:
    """Precisions (P,) that predict left-out trials best (infinite: not shared), and what they leave of each trial (N,)."""
    normal = [_normal(x, y) for x, y in scaled]
    G, h = sum(n[0] for n in normal), sum(n[1] for n in normal)
    used = np.flatnonzero(groups < 3)
    cut = np.ix_(used, used)

    def residuals(prior: Array) -> list[Array]:
        out = []
        for (x, y), (g, m) in zip(scaled, normal, strict=True):
            b = np.linalg.solve((G - g)[cut] + np.diag(prior[used]), (h - m)[used])
            out.append(y - x[:, used] @ b)
        return out

    best: tuple[float, Array, list[Array]] | None = None
    for flexible, body, pool in RIDGES:
        prior = np.choose(groups.astype(np.int64), [flexible, 1.0 / body**2, 1.0 / pool**2, np.inf])
        rest = residuals(prior)
        # all but the strangest trial
        cost = float(np.sort([huber(e).sum() for e in rest])[:-1].sum())
        if best is None or cost < best[0]:
            best = cost, prior, rest
    assert best is not None
    return best[1], best[2]


def _spreads(old: Sequence[TrialRows], residuals: Sequence[Array]) -> Array:
    """Robust deviation (CHANNELS,) of residuals of left-out trials; 1 where there are none."""
    rest, channel = np.concatenate(residuals), np.concatenate([t.channel for t in old])
    valid = np.concatenate([t.valid for t in old])
    found = np.ones(CHANNELS)
    for c in range(CHANNELS):
        own = np.abs(rest[(channel == c) & valid])
        if len(own):
            found[c] = max(1.4826 * float(np.median(own)), 1e-6)
    return found


def _robust(
    scaled: Sequence[tuple[Array, Array]], used: NDArray[np.int64], precision: Array
) -> tuple[list[Array], Array]:
    """Roots of Huber's weights (N,) of each trial by the shared columns, and its mean square of residuals."""
    weights = [np.ones(len(y)) for _, y in scaled]
    rest: list[Array] = []
    for _ in range(3):
        normal = [
            _normal(x[:, used] * w[:, None], y * w)
            for (x, y), w in zip(scaled, weights, strict=True)
        ]
        G, h = sum(n[0] for n in normal), sum(n[1] for n in normal)
        b = np.linalg.solve(G + np.diag(precision), h)
        rest = [y - x[:, used] @ b for x, y in scaled]
        weights = [np.sqrt(weight(e)) for e in rest]
    e = np.concatenate(rest)
    scale = max(float(np.sqrt(np.median(e[e != 0.0] ** 2) / 0.455)), SMALLEST_SCALE)
    squares = np.array([np.mean(np.minimum(np.abs(e[e != 0.0]), 30.0) ** 2) for e in rest])
    return [w / scale for w in weights], squares
