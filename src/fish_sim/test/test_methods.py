# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tableaus: order of convergence, and what they do to an oscillation."""

import numpy as np
import pytest
from scipy.integrate import DOP853, solve_ivp

from fish_sim.methods import METHODS
from fish_sim.scheme import growth

ORDERS = {"euler": 1, "rk4": 4, "cfmr7": 7, "dop853": 8}


def pendulum(t, y):
    return np.array([y[1], -np.sin(y[0]) + 0.5 * np.cos(1.3 * t)])


def integrate(method, steps, end=2.0):
    y, h = np.array([1.0, 0.3]), end / steps
    for i in range(steps):
        K = np.zeros((len(method.B), 2))
        for s, (a, c) in enumerate(zip(method.A, method.C, strict=True)):
            K[s] = pendulum((i + c) * h, y + h * np.array(a) @ K)
        y = y + h * np.array(method.B) @ K
    return y


@pytest.mark.parametrize("name", METHODS)
def test_error_falls_with_the_order_of_the_method(name):
    exact = solve_ivp(pendulum, (0.0, 2.0), [1.0, 0.3], method="DOP853", rtol=3e-14, atol=1e-15).y[
        :, -1
    ]
    errors = [np.abs(integrate(METHODS[name], steps) - exact).max() for steps in (4, 8)]
    assert np.log2(errors[0] / errors[1]) > ORDERS[name] - 0.5
    np.testing.assert_allclose(np.sum(METHODS[name].A, axis=1), METHODS[name].C, atol=1e-12)


def test_the_literals_of_dop853_are_those_of_scipy():
    method = METHODS["dop853"]
    np.testing.assert_array_equal(method.A, DOP853.A[:12, :12])
    np.testing.assert_array_equal(method.B, DOP853.B)
    np.testing.assert_array_equal(method.C, DOP853.C[:12])


def test_cfmr7_keeps_an_oscillation_that_rk4_damps():
    turn = 0.75  # rad a step: the fastest mode of three links in steps of 5 ms
    mode = np.array([100j * turn])
    assert abs(growth(METHODS["cfmr7"], mode, 1) - 1.0) < 2e-8
    assert growth(METHODS["rk4"], mode, 1) < 1.0 - 1e-3


@pytest.mark.parametrize("mode", [-3.0 + 40.0j, -250.0, -1e7 + 1e7j])
def test_growth_is_the_stability_polynomial_also_far_from_stable(mode):
    """R(z) of euler and rk4 is the exponential series to their order; at huge z a linear solver finds I - z A singular."""
    z = mode * 0.01
    modes = np.array([mode], dtype=complex)
    assert growth(METHODS["euler"], modes, 1) == pytest.approx(abs(1 + z))
    assert growth(METHODS["rk4"], modes, 1) == pytest.approx(
        abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    )
    assert np.isfinite(growth(METHODS["dop853"], modes, 1))
