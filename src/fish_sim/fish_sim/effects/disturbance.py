# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An external wrench on the head: what pushes the fish and has no name (yet)."""

import math
from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "this project: latent force of grey-box models (Kristensen, Madsen and Jorgensen 2004)"


class Disturbance(Effect):
    """A wrench on the head, in its own frame.

        (X, Y, N) = (surge, sway, yaw)

    Not part of the diagnosis vocabulary: filters drive it with noise to stand for the unexplained, simulations to
    stand for random water motion.
    """

    name = "disturbance"
    kind = "physics"
    equation = "(X, Y, N) = (surge, sway, yaw) on the head"
    source = SOURCE
    parameters = {
        "surge": Parameter(0.0, "N", -math.inf, math.inf, SOURCE, typical=0.01),
        "sway": Parameter(0.0, "N", -math.inf, math.inf, SOURCE, typical=0.05),
        "yaw": Parameter(0.0, "N m", -math.inf, math.inf, SOURCE, typical=1e-3),
    }
    strength = ("surge", "sway", "yaw")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        return (p.surge, p.sway, p.yaw) if body.name == "head" else None
