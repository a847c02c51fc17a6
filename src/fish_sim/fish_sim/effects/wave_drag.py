# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A hump of surge drag at one hull speed."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "assumption: Gaussian hump in place of the wave-resistance curve (Newman 1977)"
SMOOTHING = 0.01  # m/s, the force turns over within this speed


class WaveDrag(Effect):
    """Surface waves of the hull cost most at the speed where bow and stern waves add up.

        X = -amplitude exp(-((|u| - speed) / width)^2 / 2) tanh(u / u_0),   u_0 = 0.01 m/s

    Frame: base_link; u [m/s] relative to the water.
    """

    name = "wave_drag"
    kind = "physics"
    equation = "X = -amplitude exp(-((|u| - speed)/width)^2/2) sign(u) on the head"
    source = SOURCE
    parameters = {
        "amplitude": Parameter(0.0, "N", 0.0, 2.0, SOURCE, typical=0.02),
        "speed": Parameter(
            0.22, "m/s", 0.02, 1.0, SOURCE, tries=(0.08, 0.12, 0.17, 0.22, 0.28, 0.35)
        ),
        "width": Parameter(0.04, "m/s", 0.005, 0.5, SOURCE),
    }
    strength = ("amplitude",)
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        off = (xp.fabs(body.u) - p.speed) / p.width
        return -p.amplitude * xp.exp(-0.5 * off**2) * xp.tanh(body.u / SMOOTHING), 0.0, 0.0
