# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The factorisation on generic scalars against LAPACK's, and on a matrix that needs its pivots' reciprocals."""

import numpy as np
import pytest

from fish_sim.ops import back_substitute, factorise, reduce


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_factorisation_solves_as_lapack_does(size: int) -> None:
    rng = np.random.default_rng(size)
    root = rng.normal(size=(size, size))
    M, b = root @ root.T + 0.1 * np.eye(size), rng.normal(size=size)
    L, inverse = factorise(np.tril(M).tolist())
    x = back_substitute(L, inverse, reduce(L, b))
    assert np.allclose(x, np.linalg.solve(M, b), rtol=1e-9)


def test_pivots_are_those_of_cholesky() -> None:
    M = np.array([[4.0, 2.0], [2.0, 5.0]])
    L, inverse = factorise(np.tril(M).tolist())
    assert inverse == [0.25, 0.25]
    assert L[1][0] == 0.5


def test_a_batch_of_matrices_is_factorised_at_once() -> None:
    first, other = np.array([2.0, 3.0]), np.array([0.5, -0.25])
    L, inverse = factorise([[first], [other, first]])
    x = back_substitute(L, inverse, reduce(L, [np.ones(2), np.zeros(2)]))
    for k in range(2):
        M = np.array([[first[k], other[k]], [other[k], first[k]]])
        assert np.allclose([x[0][k], x[1][k]], np.linalg.solve(M, [1.0, 0.0]), rtol=1e-12)
