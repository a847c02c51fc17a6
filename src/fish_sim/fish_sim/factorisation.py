# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""M = L D L^T on generic scalars: numbers, batches of numbers or symbols, so that a kernel can be built through it."""

from __future__ import annotations

from collections.abc import Sequence

from fish_sim.ops import Scalar


def factorise(M: list[list[Scalar]]) -> tuple[list[list[Scalar]], list[Scalar]]:
    """M = L D L^T of a symmetric positive definite matrix of scalars, given below its diagonal: (L, 1/D)."""
    size = len(M)
    L: list[list[Scalar]] = [[0.0] * size for _ in range(size)]
    D: list[Scalar] = []
    inverse: list[Scalar] = []
    for j in range(size):
        scaled = [L[j][k] * D[k] for k in range(j)]
        D.append(M[j][j] - dot(scaled, L[j][:j]))
        inverse.append(1.0 / D[j])
        for i in range(j + 1, size):
            L[i][j] = (M[i][j] - dot(L[i][:j], scaled)) * inverse[j]
    return L, inverse


def reduce(L: list[list[Scalar]], b: Sequence[Scalar]) -> list[Scalar]:
    """L^-1 b."""
    x = list(b)
    for i in range(len(x)):
        for k in range(i):
            x[i] = x[i] - L[i][k] * x[k]
    return x


def back_substitute(
    L: list[list[Scalar]], inverse: Sequence[Scalar], b: Sequence[Scalar]
) -> list[Scalar]:
    """(D L^T)^-1 b."""
    x = [value * d for value, d in zip(b, inverse, strict=True)]
    for i in reversed(range(len(x))):
        for k in range(i + 1, len(x)):
            x[i] = x[i] - L[k][i] * x[k]
    return x


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Inner product of two lists of scalars."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
