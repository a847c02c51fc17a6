# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shortest set of swims that determines parameters to given errors, and a bound that no set can be shorter than.

    min over counts n   sum of n_i t_i    so that   [(P^-2 + sum of n_i N_ir)^-1]_kk <= s_k^2   for all parameters k, robots r

N_ir: information of swim i on robot r, P: prior deviations, s: wanted errors (an optimal design with bounds on variances;
Pukelsheim 2006, ch. 9). Swims are added greedily, the one that brings errors down most for its time, then every swim is left out,
or put in the place of a longer one, while the bounds hold. With n real the problem is convex: its optimum is the bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

MOST_REPEATS = 3  # of the same swim
MOST_SWIMS = 40


def standard_errors(information: Array, counts: Array | Counts, prior: Array) -> Array:
    """(R, K) of information (R, M, K, K) of each swim on each robot, and of a prior (K,)."""
    total = np.tensordot(counts, information, axes=(0, 1)) + np.diag(1.0 / prior**2)
    return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(total), axis1=1, axis2=2)))


def reachable(information: Array, prior: Array) -> Array:
    """(K,) errors of the worst robot with every swim swum MOST_REPEATS times: no plan reaches less."""
    everything = np.full(information.shape[1], float(MOST_REPEATS))
    return np.asarray(standard_errors(information, everything, prior).max(axis=0))


def shortest_set(information: Array, seconds: Array, prior: Array, wanted: Array) -> Counts:
    """How often each swim is swum (M,), for errors wanted (K,) that are reachable.

    Raises ValueError where MOST_SWIMS do not suffice.
    """
    counts: Counts = np.zeros(information.shape[1], dtype=np.int64)
    while (before := _excess(information, counts, prior, wanted)) > 0.0:
        if counts.sum() == MOST_SWIMS:
            raise ValueError(f"{MOST_SWIMS} swims do not suffice: expected larger errors")
        possible = np.flatnonzero(counts < MOST_REPEATS)
        falls = [
            (before - _excess(information, _with(counts, int(i), 1), prior, wanted)) / seconds[i]
            for i in possible
        ]
        counts = _with(counts, int(possible[np.argmax(falls)]), 1)
    return _shortened(information, seconds, prior, wanted, counts)


def shortest_possible(information: Array, seconds: Array, prior: Array, wanted: Array) -> float:
    """Seconds that no set of these swims can do with less of, parts of swims included."""
    R, M, K, _ = information.shape
    start = np.full(M, float(MOST_REPEATS))

    def inverse(n: Array) -> Array:
        return np.asarray(
            np.linalg.inv(np.tensordot(n, information, axes=(0, 1)) + np.diag(1.0 / prior**2))
        )

    def slack(n: Array) -> Array:
        return (1.0 - np.diagonal(inverse(n), axis1=1, axis2=2) / wanted**2).ravel()

    def slopes(n: Array) -> Array:
        V = inverse(n)
        turned = np.einsum("rka,rmab,rkb->rkm", V, information, V, optimize=True)
        return np.asarray((turned / wanted[:, None] ** 2).reshape(R * K, M))

    found = minimize(
        lambda n: float(seconds @ n) / seconds.sum(),
        start,
        jac=lambda _: seconds / seconds.sum(),
        method="SLSQP",
        bounds=[(0.0, float(MOST_REPEATS))] * M,
        constraints={"type": "ineq", "fun": slack, "jac": slopes},
        options={"maxiter": 200, "ftol": 1e-7},
    )
    return float(seconds @ found.x) if found.success else 0.0


def _excess(information: Array, counts: Counts, prior: Array, wanted: Array) -> float:
    """Sum over parameters of the logarithms by which the worst robot's errors are too large; 0: all bounds hold."""
    worst = standard_errors(information, counts, prior).max(axis=0)
    return float(np.maximum(np.log(worst / wanted), 0.0).sum())


def _with(counts: Counts, i: int, more: int) -> Counts:
    out = counts.copy()
    out[i] += more
    return out


def _shortened(
    information: Array, seconds: Array, prior: Array, wanted: Array, counts: Counts
) -> Counts:
    """Swims left out, or changed for shorter ones, as long as the bounds hold."""
    changed = True
    while changed:
        changed = False
        for i in sorted(np.flatnonzero(counts), key=lambda i: -seconds[i]):
            without = _with(counts, int(i), -1)
            shorter = [
                None,
                *np.argsort(seconds, kind="stable")[: int((seconds < seconds[i]).sum())],
            ]
            for other in shorter:
                tried = without if other is None else _with(without, int(other), 1)
                if tried.max() > MOST_REPEATS:
                    continue
                if _excess(information, tried, prior, wanted) == 0.0:
                    counts, changed = tried, True
                    break
            if changed:
                break
    return counts
