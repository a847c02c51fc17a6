# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Part of the tip's grip answers late."""

from collections.abc import Mapping
from typing import Any

from fish_sim.effects.effect import Drive, Effect, Grip, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "one-lag approximation of Wagner's lift build-up (Fung 1955); strengths are an assumption"


class WakeMemory(Effect):
    """The shed wake lets a share of the grip force follow the slip with a time constant.

        force = -((1 - share) slip + share wake) / mobility,   wake' = (slip - wake) / time_constant

    slip, wake [m/s]. Share 0 is `tip_slip`; mobility 0 and share 0 are the no-slip constraint.
    """

    name = "wake_memory"
    kind = "physics"
    equation = (
        "tip force = -((1 - share) slip + share wake)/mobility, wake' = (slip - wake)/time_constant"
    )
    source = SOURCE
    parameters = {
        "mobility": Parameter(0.0, "m/(N s)", 0.0, 10.0, SOURCE, typical=1.0 / 8.0),
        "share": Parameter(0.0, "1", 0.0, 0.95, SOURCE, typical=0.5),
        "time_constant": Parameter(0.3, "s", 0.02, 10.0, SOURCE),
    }
    strength = ("mobility", "share")
    states = ("wake",)

    @staticmethod
    def grip(p: Values, z: Values, xp: Any) -> Grip:
        return Grip(p.mobility, p.share, p.share * z.wake)

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return ((slip - z.wake) / p.time_constant,)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {"grip": (1.0 / p.mobility if p.mobility > 0 else float("inf"), "N s/m")}
