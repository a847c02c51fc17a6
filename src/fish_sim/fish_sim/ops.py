# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the equations need of arithmetic, for every carrier of numbers they run on: elementary functions, a factorisation.

The equations of `dynamics.py` and of the effects take one of these tables as `xp` and therefore work on NumPy
arrays, CasADi symbols (which become compiled kernels) and torch tensors on any device alike. M = L D L^T is written out
on generic scalars, so that a kernel can be built through it.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np

Scalar = Any  # float, numpy array, casadi.SX or torch tensor: whatever xp works on

NUMPY = SimpleNamespace(
    sin=np.sin,
    cos=np.cos,
    exp=np.exp,
    sqrt=np.sqrt,
    tanh=np.tanh,
    fabs=np.abs,
    sign=np.sign,
    floor=np.floor,
    fmin=np.minimum,
    fmax=np.maximum,
    arctan2=np.arctan2,
    where=np.where,
)

CASADI = SimpleNamespace(
    sin=casadi.sin,
    cos=casadi.cos,
    exp=casadi.exp,
    sqrt=casadi.sqrt,
    tanh=casadi.tanh,
    fabs=casadi.fabs,
    sign=casadi.sign,
    floor=casadi.floor,
    fmin=casadi.fmin,
    fmax=casadi.fmax,
    arctan2=casadi.atan2,
    where=casadi.if_else,
)


def torch_ops() -> SimpleNamespace:
    """The table for torch tensors; torch is imported only when somebody asks for it."""
    import torch

    def tensor(value: Scalar, like: torch.Tensor) -> torch.Tensor:
        return torch.as_tensor(value, dtype=like.dtype, device=like.device)

    def pairwise(function: Any) -> Any:
        def apply(a: Scalar, b: Scalar) -> torch.Tensor:
            like = a if isinstance(a, torch.Tensor) else b
            result: torch.Tensor = function(tensor(a, like), tensor(b, like))
            return result

        return apply

    def elementwise(function: Any) -> Any:
        def apply(a: Scalar) -> torch.Tensor:
            result: torch.Tensor = function(
                a if isinstance(a, torch.Tensor) else torch.tensor(a, dtype=torch.float64)
            )
            return result

        return apply

    names = {"fabs": "abs", "arctan2": "atan2", "fmin": "minimum", "fmax": "maximum"}
    one = {k: elementwise(getattr(torch, names.get(k, k))) for k in ONE_ARGUMENT}
    two = {k: pairwise(getattr(torch, names.get(k, k))) for k in ("fmin", "fmax", "arctan2")}

    def where(condition: torch.Tensor, a: Scalar, b: Scalar) -> torch.Tensor:
        like = (
            a
            if isinstance(a, torch.Tensor)
            else b
            if isinstance(b, torch.Tensor)
            else torch.zeros(())
        )
        return torch.where(condition, tensor(a, like), tensor(b, like))

    return SimpleNamespace(**one, **two, where=where)


ONE_ARGUMENT = ("sin", "cos", "exp", "sqrt", "tanh", "fabs", "sign", "floor")


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
