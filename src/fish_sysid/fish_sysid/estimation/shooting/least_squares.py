# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Robust least squares of many windows and trials: Huber's function, Schur's complement, errors clustered by trial.

Huber's function is quadratic up to ROBUST and linear beyond. The start states of windows are eliminated from the normal
equations:

[A   B_1 .. B_W] [dz ]     [g  ]
[B_1' H_1      ] [dx_1]  = -[g_1]
[ ..       ..  ] [ .. ]     [ ..]

S = A - sum of B_w H_w^-1 B_w',   s = g - sum of B_w H_w^-1 g_w,   S dz = -s,   H_w dx_w = -(g_w + B_w' dz)

Errors of a wrong model last for seconds, so that a covariance that counts them as independent is many times too small. Those of
a trial hang together, as the sandwich has it (Liang and Zeger 1986; Cameron and Miller 2015):

    C = N^-1 (M / (M - 1) sum over trials of s_m s_m' + diag(1 / prior^2)) N^-1

N: Gauss-Newton matrix with the prior; s_m: gradient of trial m's cost. What the trials do not determine keeps the prior's width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROBUST = 3.0  # scaled errors beyond it count linearly


def huber(e: Array) -> Array:
    """Huber's cost of scaled errors, in their shape."""
    size = np.abs(e)
    return np.where(size < ROBUST, 0.5 * e**2, ROBUST * size - 0.5 * ROBUST**2)


def weight(e: Array) -> Array:
    """Weights of scaled errors, in their shape, with which a quadratic cost has the same gradient."""
    return np.minimum(1.0, ROBUST / np.maximum(np.abs(e), 1e-9))


@dataclass(frozen=True)
class Blocks:
    """Gauss-Newton matrices of P parameters and W start states of X numbers each."""

    A: Array  # (W, P, P) what each window says of the parameters
    g: Array  # (W, P)
    B: Array  # (W, P, X)
    H: Array  # (W, X, X)
    h: Array  # (W, X)


@dataclass(frozen=True)
class Reduced:
    """What is left for the parameters."""

    matrix: Array  # (W, P, P) by window
    gradient: Array  # (W, P)
    solved_B: Array  # (W, X, P) H^-1 B'
    solved_h: Array  # (W, X) H^-1 h

    def start_moves(self, dz: Array) -> Array:
        """(W, X) moves of the start states that go with a move dz (P,) of the parameters."""
        return -(self.solved_h + self.solved_B @ dz)


def eliminate(blocks: Blocks, damping: float = 0.0) -> Reduced:
    """Schur's complement, with `damping` times the diagonal added to every H."""
    H = blocks.H.copy()
    at = np.arange(H.shape[1])
    H[:, at, at] *= 1.0 + damping
    both = np.concatenate([blocks.B.transpose(0, 2, 1), blocks.h[:, :, None]], axis=2)
    solved = np.linalg.solve(H, both)
    solved_B, solved_h = solved[:, :, :-1], solved[:, :, -1]
    return Reduced(
        blocks.A - blocks.B @ solved_B,
        blocks.g - np.einsum("wpx,wx->wp", blocks.B, solved_h),
        solved_B,
        solved_h,
    )


def clustered_covariance(scores: Array, normal: Array, prior: Array) -> Array:
    """(P, P) from scores by trial (M, P), the normal matrix with the prior (P, P) and the prior's deviations (P,).

    A trial without an error has a score of 0 and does not count. Of a single trial nothing is known but its normal matrix: C is
    its inverse.
    """
    said = scores[np.any(scores != 0.0, axis=1)]
    count = len(said)
    bread = np.linalg.inv(normal)
    if count < 2:
        return np.asarray(bread)
    centred = said - said.mean(axis=0)
    meat = count / (count - 1.0) * centred.T @ centred + np.diag(1.0 / prior**2)
    return np.asarray(bread @ meat @ bread)


def scores_by_trial(e: Array, weighted: Array, J: Array, trial: NDArray[np.int64]) -> Array:
    """(M, P) sums of J' W e of errors e (R,) with weights (R,), slopes J (R, P) and the trial of each."""
    count = int(trial.max()) + 1 if len(trial) else 0
    out = np.zeros((count, J.shape[1]))
    np.add.at(out, trial, J * (weighted * e)[:, None])
    return out
