# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Normal equations of parameters and many start states, the start states eliminated by Schur's complement.

[A   B_1 .. B_W] [dz ]     [g  ]
[B_1' H_1      ] [dx_1]  = -[g_1]
[ ..       ..  ] [ .. ]     [ ..]

S = A - sum of B_w H_w^-1 B_w',   s = g - sum of B_w H_w^-1 g_w,   S dz = -s,   H_w dx_w = -(g_w + B_w' dz)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
