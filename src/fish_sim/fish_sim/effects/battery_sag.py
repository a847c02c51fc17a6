# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A battery whose voltage gives way under load."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = (
    "first-order (Thevenin) battery, speed proportional to voltage; strengths are an assumption"
)
REFERENCE_SPEED = 100.0  # rad/s, load 1


class BatterySag(Effect):
    """The rotor turns slower than commanded by what the load takes from the voltage.

        speed = command max(0, 1 - sag load),   load' = ((command / 100 rad/s)^2 - load) / time_constant

    The load is the smoothed square of the commanded speed, 0 at the start; a long time constant means running down.
    """

    name = "battery_sag"
    kind = "actuator"
    equation = (
        "speed = command (1 - sag load), load' = ((command/100 rad/s)^2 - load)/time_constant"
    )
    source = SOURCE
    parameters = {
        "sag": Parameter(0.0, "1", 0.0, 2.0, SOURCE, typical=0.2),
        "time_constant": Parameter(1.0, "s", 0.02, 1000.0, SOURCE),
    }
    strength = ("sag",)
    memory = ("load",)

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        reached = 1.0 - xp.exp(-dt / p.time_constant)
        load = m.load + reached * ((command / REFERENCE_SPEED) ** 2 - m.load)
        return command * xp.fmax(0.0, 1.0 - p.sag * load), {"load": load}
